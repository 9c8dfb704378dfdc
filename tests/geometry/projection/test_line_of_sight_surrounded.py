# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from tests.cars import drive_by

from wildshape.geometry.projection.line_of_sight import surrounded


def test_no_scan_surrounds_its_sensor_until_it_is_moved_to_its_centre() -> None:
    for scan in drive_by().scans:
        assert not surrounded(scan)
        assert surrounded(scan - scan.mean(0))


def test_the_hull_decides() -> None:
    rng = np.random.default_rng(0)
    answers = []
    for _ in range(300):
        points = rng.normal(size=(20, 3)) + rng.normal(size=3)
        offsets = ConvexHull(points).equations[:, 3]
        if abs(offsets.max()) < 0.2:  # too near to the hull's side to be told
            continue
        answers.append(surrounded(points))
        assert answers[-1] == (offsets.max() < 0)
    assert 50 < sum(answers) < len(answers) - 50


@pytest.mark.parametrize(("away", "inside"), [(0.0, True), (0.3, False), (-0.3, False)])
def test_a_flat_side_is_seen_from_before_or_behind_and_never_from_within(
    away: float, inside: bool
) -> None:
    wall = np.random.default_rng(1).uniform(-1, 1, (200, 3)) * [3, 0, 1] + [0, away, 0]
    assert surrounded(wall) is inside


def test_a_long_side_close_by_and_a_car_below_the_sensor_are_no_surroundings() -> None:
    rng = np.random.default_rng(2)
    side = rng.uniform(-1, 1, (500, 3)) * [8, 0, 1.7] + [2, 0.4, -0.2]
    turn = np.array([[1, -1, 0], [1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    assert not surrounded(side)
    assert not surrounded(side @ turn.T)
    assert not surrounded(rng.uniform(-1, 1, (500, 3)) * [2, 1, 0.5] - [0, 0, 1])
