# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles of one lane through long drives."""

from itertools import combinations

import numpy as np
import pytest

from wildshape.simulate.shapes.solid import Solid, box
from wildshape.simulate.street.street import LANE_M, LEAD_M, random_street
from wildshape.simulate.street.traffic import traffic


def box_of(length: float, width: float) -> Solid:
    return box((-length / 2, -width / 2, 0.0), (length / 2, width / 2, 1.6))


@pytest.mark.parametrize("length", [9.0, 18.0, 28.0])
@pytest.mark.parametrize("seed", range(8))
def test_nobody_drives_through_another_in_two_minutes(seed: int, length: float) -> None:
    seconds = 120.0
    street = random_street(seed, seconds, None, lambda _: box_of(length, 1.8))
    actors = traffic(street, float(street.ego.at(seconds)) + LEAD_M, seconds, seed)
    lane = [actor for actor in actors if actor.moving and abs(actor.lateral) == LANE_M / 2]
    times = np.linspace(0.0, seconds, 600)
    for one in lane:
        if one.lateral == -LANE_M / 2:  # of the sensor's own vehicle
            apart = np.abs(one.motion.at(times) - street.ego.at(times))
            assert apart.min() > one.size[0] / 2 + 5.0
    for one, other in combinations(lane, 2):
        if one.lateral == other.lateral:
            apart = np.abs(one.motion.at(times) - other.motion.at(times))
            assert apart.min() > (one.size[0] + other.size[0]) / 2


def test_no_place_at_the_kerb_is_looked_for_without_end() -> None:
    street = random_street(1, 10.0, None, lambda _: box_of(11.0, 2.6))
    actors = traffic(street, 100.0, 10.0, 1)
    assert not any(abs(actor.lateral) < street.half_m for actor in actors if not actor.moving)
