# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""More points of a shape: middles in its gaps, and what its scans saw in place of some."""

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from tests.cars import car_surface

from wildshape.geometry.densify import denser, partners, with_exact, with_seen
from wildshape.geometry.sampling import voxel_thin

SHAPE = car_surface(4000, seed=5)[0].astype(np.float32)
VOXEL, NEAR, PARTNER = 0.07, 0.15, 5
OTHER_SIDE = np.array((1, -1, 1), np.float32)


def twice_as_many(points):
    given = torch.from_numpy(points)[None]
    return denser(given, partners(given, PARTNER))[0].numpy()


def test_denser_fills_gaps_and_keeps_the_points():
    dense = twice_as_many(SHAPE)
    assert dense.shape == (2 * len(SHAPE), 3)
    assert dense.dtype == SHAPE.dtype
    np.testing.assert_array_equal(dense[: len(SHAPE)], SHAPE)
    spacing = KDTree(SHAPE).query(SHAPE, k=6)[0][:, 5]
    added = KDTree(SHAPE).query(dense[len(SHAPE) :])[0]
    assert (added <= spacing / 2 + 1e-6).all()
    assert len(np.unique(dense.round(6), axis=0)) > 1.8 * len(SHAPE)
    other = car_surface(3000, seed=6)[0]
    assert KDTree(dense).query(other)[0].mean() < 0.9 * KDTree(SHAPE).query(other)[0].mean()


def symmetric(points):
    return np.concatenate((points, points * OTHER_SIDE))


def test_an_exact_scan_takes_the_place_of_points_put_between():
    """What the scan saw is nearer, the rest is as it was."""
    shape = SHAPE[::4] + np.array((0.0, 0.0, 0.04), dtype=np.float32)
    seen = SHAPE[SHAPE[:, 0] > 0]
    plain = twice_as_many(shape)
    added = with_exact(plain[len(shape) :], shape, seen, mirror=False)
    truth = KDTree(np.concatenate((shape, added)))
    assert truth.query(seen)[0].mean() < 0.7 * KDTree(plain).query(seen)[0].mean()
    behind = plain[plain[:, 0] < -0.5]
    assert truth.query(behind)[0].max() == 0


def test_what_an_exact_scan_saw_of_one_side_is_on_both():
    shape = symmetric(SHAPE[SHAPE[:, 1] > 0][::8]) + np.array((0.0, 0.0, 0.04), dtype=np.float32)
    seen = SHAPE[SHAPE[:, 1] > 0.2]
    middles = twice_as_many(shape)[len(shape) :]
    apart = {}
    for mirror in (True, False):
        whole = KDTree(np.concatenate((shape, with_exact(middles, shape, seen, mirror=mirror))))
        apart[mirror] = [whole.query(side)[0].mean() for side in (seen, seen * OTHER_SIDE)]
    assert apart[True][1] == pytest.approx(apart[True][0], rel=0.02)
    assert apart[True][1] < 0.7 * apart[False][1]


def lidar_points(points, seen, mirror=True, voxel=VOXEL, near=NEAR):
    """The shape's own points, and those that `with_seen` adds."""
    middles = twice_as_many(points)[len(points) :]
    added = with_seen(middles, points, seen, mirror=mirror, voxel=voxel, near=near)
    return np.concatenate((points, added))


def test_what_a_lidar_saw_of_one_side_is_in_the_shape_on_both():
    """As many points as before, alike on both sides; what the scan saw of a mirror is there."""
    shape = symmetric(SHAPE[SHAPE[:, 1] > 0][::2])
    wing = np.array((0.8, 1.0, 1.0), np.float32) + np.zeros((40, 3), np.float32)
    wing[:, 2] += np.linspace(0, 0.1, 40, dtype=np.float32)
    wing += shape[np.argmin(np.abs(shape - (0.8, 0.85, 1.0)).sum(1))] - wing[0] + (0, 0.12, 0)
    seen = np.concatenate((SHAPE[(SHAPE[:, 0] > 0) & (SHAPE[:, 1] > 0)][::2], wing))
    plain = twice_as_many(shape)
    whole = lidar_points(shape, seen)
    assert whole.shape == plain.shape
    assert whole.dtype == plain.dtype
    np.testing.assert_array_equal(whole[: len(shape)], shape)
    there = KDTree(whole)
    for points in (seen, wing):
        for side in (points, points * OTHER_SIDE):
            assert there.query(side)[0].mean() < 0.7 * KDTree(plain).query(side)[0].mean()
    half = len(shape) // 2
    left, right = whole[len(shape) : len(shape) + half], whole[len(shape) + half :]
    np.testing.assert_array_equal(left * OTHER_SIDE, right)
    behind = plain[plain[:, 0] < -0.5]
    assert there.query(behind)[0].max() == 0


def test_an_object_that_is_not_symmetric_gets_what_was_seen_where_it_was_seen():
    seen = SHAPE[(SHAPE[:, 0] > 0) & (SHAPE[:, 1] > 0)] + np.array((0, 0.1, 0), np.float32)
    whole = lidar_points(SHAPE[::2], seen, mirror=False, near=0.5)
    thinned = voxel_thin(seen, VOXEL)
    assert KDTree(whole).query(thinned)[0].max() == 0
    assert KDTree(whole).query(thinned * OTHER_SIDE)[0].mean() > 0.05


def test_what_lies_far_from_the_shape_is_not_in_it():
    """Ground, a neighbour, a mixed return; where nothing else was seen, all stays as it was."""
    shape = symmetric(SHAPE[SHAPE[:, 1] > 0][::2])
    stray = np.array([[0, 3, 0.5], [4, 0, 0]], np.float32)
    seen = SHAPE[SHAPE[:, 0] > 0]
    with_strays = lidar_points(shape, np.concatenate((seen, stray)))
    np.testing.assert_array_equal(with_strays, lidar_points(shape, seen))
    np.testing.assert_array_equal(lidar_points(shape, stray), twice_as_many(shape))


def test_more_was_seen_than_there_are_middles():
    """All of them make room, and no more than they were."""
    shape = symmetric(SHAPE[SHAPE[:, 1] > 0][:60])
    whole = lidar_points(shape, SHAPE, near=0.5)
    assert len(whole) == 2 * len(shape)
    apart = KDTree(voxel_thin(SHAPE * np.sign(SHAPE[:, 1:2]) ** (0, 1, 0), VOXEL))
    left = whole[len(shape) : len(shape) * 3 // 2]
    assert apart.query(left)[0].max() < 0.02


@pytest.mark.parametrize("mirror", [True, False])
def test_of_shapes_half_as_large_all_is_half_as_large(mirror):
    shape, seen = symmetric(SHAPE[SHAPE[:, 1] > 0][::2]), SHAPE[SHAPE[:, 0] > 0]
    large = lidar_points(shape, seen, mirror)
    small = lidar_points(shape / 2, seen / 2, mirror, VOXEL / 2, NEAR / 2)
    np.testing.assert_allclose(small, large / 2, atol=1e-6)
