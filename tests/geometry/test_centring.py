# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.strategies import clouds

from wildshape.geometry.centring import box_centre, frustum_centre, scan_centre
from wildshape.geometry.projection.spherical import Spherical, from_spherical
from wildshape.geometry.transforms.rotation import rotation_z


def turned(points, yaw):
    return points @ rotation_z(torch.tensor(yaw, dtype=points.dtype)).mT


def object_ahead(seed=0):
    """Some 4 m long, 10 m ahead."""
    return clouds(seed, 60, 3) + torch.tensor([10.0, 0.5, -1.0], dtype=torch.float64)


@given(st.floats(-math.pi, math.pi), st.integers(0, 20))
def test_frustum_centre_turns_with_the_scan(yaw, seed):
    points = object_ahead(seed)
    there = turned(frustum_centre(points), yaw)
    torch.testing.assert_close(frustum_centre(turned(points, yaw)), there, atol=1e-9, rtol=0)


@pytest.mark.parametrize("off", [-0.1, -1e-9, 0.0, 1e-9, 0.1])
def test_an_object_across_the_seam_is_not_torn(off):
    points = object_ahead()
    behind = turned(points, math.pi + off)
    assert (behind[:, 1] > 0).any()
    assert (behind[:, 1] < 0).any()
    back = turned(frustum_centre(behind), -math.pi - off)
    torch.testing.assert_close(back, frustum_centre(points), atol=1e-9, rtol=0)


def test_frustum_centre_by_hand():
    """Middles of azimuth -0.1 to 0.3, pitch 0 to 0.2, range 5 to 7: not the mean of the points."""
    corners = torch.tensor([(-0.1, 0.0, 5.0), (0.3, 0.2, 7.0), (0.3, 0.2, 6.9), (0.25, 0.1, 6.0)])
    corners = corners.double()
    points = from_spherical(Spherical(corners[:, 0], corners[:, 1], corners[:, 2]))
    expected = [
        6 * math.cos(0.1) * math.cos(0.1),
        6 * math.cos(0.1) * math.sin(0.1),
        6 * math.sin(0.1),
    ]
    assert frustum_centre(points).tolist() == pytest.approx(expected)


def test_centre_does_not_depend_on_density_or_order():
    points = object_ahead()
    crowded = torch.cat((points, points[:5].repeat(100, 1)))[torch.randperm(560)]
    torch.testing.assert_close(frustum_centre(crowded), frustum_centre(points))
    assert torch.equal(box_centre(crowded), box_centre(points))


def test_box_centre_by_hand():
    points = torch.tensor([[0.0, 0, 2], [4, -2, 3], [1, 0, 2], [1, 0, 2]])
    assert box_centre(points).tolist() == [2, -1, 2.5]


def test_the_sensor_decides():
    points = object_ahead()
    assert torch.equal(scan_centre(points, "lidar"), frustum_centre(points))
    assert torch.equal(scan_centre(points, "camera"), box_centre(points))
    assert not torch.equal(frustum_centre(points), box_centre(points))
