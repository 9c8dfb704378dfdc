# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests import naive
from tests.strategies import clouds

from wildshape.geometry.projection.visibility import (
    FacingBins,
    PixelBins,
    PolarBins,
    bin_points,
    facing_rotation,
    pixel_bins,
    polar_bins,
)
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.ops.zbuffer import visible

PROJECTIONS = [PolarBins(0.03, 0.02), FacingBins(0.25), PixelBins(1 / 30)]
LIDAR = [PolarBins(0.03, 0.02), FacingBins(0.25)]


def seen(points, centre, projection):
    bins = bin_points(points[None], centre[None], projection)
    return bins, visible(bins.index, bins.depth, bins.count)[0]


def ahead(projection, distance):
    """A point straight ahead of the sensor."""
    axis = (0.0, 0.0, 1.0) if isinstance(projection, PixelBins) else (1.0, 0.0, 0.0)
    return distance * torch.tensor(axis, dtype=torch.float64)


def scene(projection, seed=0, count=300):
    centre = ahead(projection, 8.0) + torch.tensor([0.3, -0.4, 0.2], dtype=torch.float64)
    return clouds(seed, count, 3) + centre, centre


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_equal_to_the_loop(projection, seed):
    points, centre = scene(projection, seed)
    _, mask = seen(points, centre, projection)
    assert 0 < int(mask.sum()) < len(points)
    assert torch.nonzero(mask)[:, 0].tolist() == naive.visible(points, centre, projection)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_a_wall_hides_what_is_behind_it_and_nothing_else(projection):
    """A dense wall 2 m square at 5 m; a board of 1 m right behind it, another one beside it."""
    grid = torch.linspace(-1, 1, 81, dtype=torch.float64)
    first, second = torch.meshgrid(grid, grid, indexing="ij")
    flat = torch.stack((first.flatten(), second.flatten(), torch.zeros(81 * 81).double()), 1)
    if not isinstance(projection, PixelBins):
        flat = flat.roll(1, dims=1)
    wall = flat + ahead(projection, 5.0)
    behind = 0.5 * flat[::7] + ahead(projection, 8.0)
    aside = ahead(projection, 0.0) + torch.tensor([3.0, 3.0, 0.0], dtype=torch.float64)
    beside = behind + (aside if isinstance(projection, PixelBins) else aside.roll(1))
    points = torch.cat((behind, wall, beside))
    _, mask = seen(points, ahead(projection, 5.0), projection)
    hidden, front, free = mask.split((len(behind), len(wall), len(beside)))
    assert not hidden.any()
    assert front.any()
    assert free.any()
    # Without the wall the board is seen: it was the wall that hid it.
    assert seen(behind, ahead(projection, 5.0), projection)[1].any()


@given(st.floats(-math.pi, math.pi), st.integers(0, 5))
def test_facing_bins_do_not_see_a_turn_of_the_whole_scene(yaw, seed):
    points, centre = scene(FacingBins(), seed)
    R = rotation_z(torch.tensor(yaw, dtype=torch.float64))
    still, mask = seen(points, centre, FacingBins(0.25))
    turned, mask_turned = seen(points @ R.mT, R @ centre, FacingBins(0.25))
    assert torch.equal(still.index, turned.index)
    assert torch.equal(mask, mask_turned)


@pytest.mark.parametrize("yaw", [math.pi - 1e-6, math.pi, -math.pi, math.pi + 0.05])
def test_facing_bins_do_not_see_the_seam(yaw):
    points, centre = scene(FacingBins())
    R = rotation_z(torch.tensor(yaw, dtype=torch.float64))
    still, _ = seen(points, centre, FacingBins(0.25))
    across, _ = seen(points @ R.mT, R @ centre, FacingBins(0.25))
    assert torch.equal(still.index, across.index)


def test_facing_bins_are_as_wide_on_the_object_at_every_range():
    """Two points 0.6 m apart never share a bin of 0.25 m; points within a bin are near."""
    for distance in (4.0, 10.0, 40.0):
        offsets = torch.linspace(-1, 1, 201, dtype=torch.float64)
        points = torch.stack((torch.full_like(offsets, distance), offsets, 0 * offsets), 1)
        bins, _ = seen(points, ahead(FacingBins(), distance), FacingBins(0.25))
        occupied = len(set(bins.index[0].tolist()))
        assert 8 <= occupied <= 9


@given(st.integers(0, 50))
def test_facing_rotation_is_proper_and_faces(seed):
    direction = clouds(seed, 8, 3)
    R = facing_rotation(direction)
    turned = (R @ direction[..., None])[..., 0]
    torch.testing.assert_close(turned[:, 0], direction.norm(dim=-1))
    torch.testing.assert_close(torch.linalg.det(R), torch.ones(8, dtype=torch.float64))


@given(st.floats(0.01, 0.6), st.floats(0.01, 0.6), st.integers(0, 20))
def test_polar_bins_hold_neighbouring_directions_alone(d_azimuth, d_pitch, seed):
    """Whatever the widths, all over the sphere: no bin joins far directions, so none is lost."""
    points = clouds(seed, 400, 3)
    poles = torch.tensor([[0.01, 0.0, 1.0], [0.01, 0.0, -1.0]], dtype=torch.float64)
    points = torch.cat((points, poles, torch.tensor([[-1.0, 0, 0], [-1.0, -1e-9, 0]]).double()))
    bins = polar_bins(points[None], PolarBins(d_azimuth, d_pitch))
    assert int(bins.index.min()) >= 0
    assert int(bins.index.max()) < bins.count
    azimuth = torch.atan2(points[:, 1], points[:, 0])
    pitch = torch.asin(points[:, 2] / points.norm(dim=1))
    same = bins.index[0][:, None] == bins.index[0]
    turn = (azimuth[:, None] - azimuth).abs()
    turn = torch.minimum(turn, 2 * math.pi - turn)
    assert float(turn[same].max()) <= d_azimuth * (1 + 1e-9)
    assert float((pitch[:, None] - pitch).abs()[same].max()) <= d_pitch * (1 + 1e-9)


def test_polar_bins_by_hand():
    """Bins of 0.1: azimuth 0.05 and 0.09 together, 0.11 apart; pitch -0.01 and 0.01 apart."""
    rows = [(0.05, 0.01), (0.09, 0.01), (0.11, 0.01), (0.05, -0.01)]
    points = [(math.cos(t) * math.cos(p), math.cos(t) * math.sin(p), math.sin(t)) for p, t in rows]
    index = polar_bins(torch.tensor([points]), PolarBins(0.1, 0.1)).index[0].tolist()
    assert index[0] == index[1]
    assert len({index[0], index[2], index[3]}) == 3


def test_behind_the_sensor_polar_bins_are_no_wider():
    """At +-pi, where 0.02 leaves 0.0016 on each side: these two may be one bin, and no more."""
    azimuth = [3.121, 3.1412, -3.1412, -3.1215]
    points = torch.tensor([[(math.cos(phi), math.sin(phi), 0.0) for phi in azimuth]])
    a, b, c, d = polar_bins(points.double(), PolarBins()).index[0].tolist()
    assert b == c
    assert len({a, b, d}) == 3


def test_pixels_by_hand_and_what_lies_outside_the_image():
    points = torch.tensor(
        [
            [0.01, 0.01, 1.0],
            [0.03, 0.03, 3.0],
            [0.04, 0.01, 1.0],
            [-0.01, 0.01, 1.0],
            [0.0, 0.0, -1.0],
            [0.0, 0.0, 0.0],
            [9.0, 0.0, 1.0],
        ]
    )
    bins = pixel_bins(points[None], PixelBins(1 / 30))
    index = bins.index[0].tolist()
    assert index[0] == index[1]
    assert len(set(index[:4])) == 3
    assert index[4:] == [-1, -1, -1]
    mask = visible(bins.index, bins.depth, bins.count)[0].tolist()
    assert mask == [True, False, True, True, False, False, False]
