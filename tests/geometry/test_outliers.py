# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from wildshape.geometry.outliers import radius_inliers, statistical_inliers, voxel_thin


def naive_statistical(points, neighbours, ratio):
    means = []
    for i, p in enumerate(points):
        others = np.delete(points, i, axis=0)
        means.append(np.sort(np.linalg.norm(others - p, axis=1))[:neighbours].mean())
    means = np.asarray(means)
    return means <= means.mean() + ratio * means.std()


def test_statistical_inliers_equal_a_slow_twin():
    points = np.random.default_rng(0).normal(size=(120, 3))
    found = statistical_inliers(points, neighbours=7, ratio=1.0)
    assert 0 < (~found).sum() < 60
    assert np.array_equal(found, naive_statistical(points, 7, 1.0))


def test_far_points_are_outliers():
    rng = np.random.default_rng(1)
    cloud = rng.random((500, 3)) * [4, 2, 0]
    points = np.concatenate((cloud, [[9, 9, 9], [-5, 0, 3]]))
    assert not statistical_inliers(points)[500:].any()
    assert statistical_inliers(points)[:500].mean() > 0.99
    assert not radius_inliers(points, radius=0.5, neighbours=1)[500:].any()


def test_radius_inliers_by_hand():
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [5, 0, 0]])
    assert radius_inliers(points, 0.15, 1).tolist() == [True, True, True, False]
    assert radius_inliers(points, 0.15, 2).tolist() == [False, True, False, False]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_tiny_clouds_are_kept_whole(count):
    points = np.zeros((count, 3))
    assert statistical_inliers(points).tolist() == [True] * count
    assert radius_inliers(points, 1.0, 0).tolist() == [True] * count
    assert len(voxel_thin(points, 0.1)) == min(count, 1)


def test_voxel_thin_takes_the_mean_of_each_cell():
    points = np.array([[0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [1.5, 0.1, 0.1], [-0.5, 0.1, 0.1]])
    expected = [[-0.5, 0.1, 0.1], [0.2, 0.1, 0.1], [1.5, 0.1, 0.1]]
    assert voxel_thin(points, 1.0) == pytest.approx(np.array(expected))


def test_voxel_thin_does_not_depend_on_order():
    rng = np.random.default_rng(2)
    points = rng.normal(size=(400, 3)).astype(np.float32)
    thin = voxel_thin(points, 0.5)
    assert thin.dtype == np.float32
    assert len(thin) < 400
    assert voxel_thin(points[::-1].copy(), 0.5) == pytest.approx(thin, abs=1e-6)


def test_voxel_thin_of_points_with_more_cells_than_an_integer_counts():
    points = np.array([[1e6, 0, 0], [0, 1e6, 0], [0, 0, 1e6], [0, 0, 1e6 + 1e-4]])
    assert voxel_thin(points, 1e-3) == pytest.approx(points[[2, 1, 0]], abs=1e-3)
