# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The end of a sensor's view shows in a track whose object reaches beyond it, and only there."""

import math

import numpy as np
import pytest
import torch
from tests.strategies import clouds

from wildshape.geometry.projection.field_of_view import highest_seen, slope, view_top, within_view

_END = math.tan(math.radians(2.0))


def drive_by(height, ranges, end=_END):
    """Highest slope of each scan of a wall so high above the sensor, whose view ends there."""
    rows = torch.linspace(-1.5, height, 200)
    found = []
    for distance in ranges:
        wall = torch.stack((torch.full_like(rows, distance), torch.ones_like(rows), rows), 1)
        slopes = slope(wall)
        found.append(float(slopes[slopes <= end].max()))
    return found


def test_slope_is_the_tangent_of_the_elevation():
    points = clouds(0, 50, 3)
    pitch = torch.atan2(points[:, 2], torch.hypot(points[:, 0], points[:, 1]))
    torch.testing.assert_close(slope(points), pitch.tan())


def test_the_end_of_the_view_is_found_on_what_reaches_beyond_it():
    highest = drive_by(2.0, np.linspace(5, 25, 20))
    assert view_top(highest) == pytest.approx(_END, abs=1e-3)


@pytest.mark.parametrize("height", [-0.3, 0.4])
def test_an_object_that_ends_below_the_end_of_the_view_shows_none(height):
    assert view_top(drive_by(height, np.linspace(15, 30, 6))) == math.inf


def test_no_scan_shows_no_end():
    assert view_top([]) == math.inf


def test_only_what_is_no_steeper_is_within_the_view():
    rays = torch.tensor([[[10.0, 0, 0.3], [10.0, 0, 0.4], [0, 10.0, -3.0]]])
    assert within_view(rays, torch.tensor([_END]))[0].tolist() == [True, False, True]


def test_the_farthest_sensor_saw_highest():
    """What lies just below the returned height is within the view of some sensor, above of none."""
    sensors = torch.tensor([[10.0, 3, 1.7], [-25.0, 2, 1.7], [4.0, 4, 1.9]])
    places = clouds(1, 30, 2).float()
    height = highest_seen(places, sensors, _END)
    for offset, expected in ((-1e-3, True), (1e-3, False)):
        points = torch.cat((places, height[:, None] + offset), 1)
        rays = points - sensors[:, None]
        assert bool((within_view(rays, torch.full((3,), _END)).any(0) == expected).all())
    assert bool(highest_seen(places, sensors, math.inf).isinf().all())
