# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from wildshape.geometry.sampling import (
    drawn,
    quantiles,
    radius_inliers,
    sorted_points,
    statistical_inliers,
    thin,
    voxel_thin,
)


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


RNG = np.random.default_rng(0)


def scan(count=50):
    return RNG.normal(size=(count, 3)).astype(np.float32) + np.array([8, 1, -1], np.float32)


def resample(points, count):
    return sorted_points(points)[drawn(len(points), count)]


@pytest.mark.parametrize("count", [16, 50, 51, 200])
def test_resampling_keeps_to_the_scan_and_does_not_see_its_order(count):
    points = scan()
    found = resample(points, count)
    assert found.shape == (count, 3)
    rows = {tuple(p) for p in points.tolist()}
    taken = [tuple(p) for p in found.tolist()]
    assert set(taken) <= rows
    assert len(set(taken)) == min(count, len(points))
    np.testing.assert_array_equal(resample(points[RNG.permutation(50)], count), found)


@pytest.mark.parametrize("ties", ["none", "z", "z and y", "signed zeros"])
def test_points_are_ordered_by_z_then_y_then_x(ties):
    points = scan(60) - np.array([8, 1, -1], np.float32)
    if ties != "none":
        points[::2, 2] = 0.5
    if ties == "z and y":
        points[::4, 1] = -0.25
    if ties == "signed zeros":
        points[::4, 2], points[1::4, 2] = 0.0, -0.0
        points[:40, 1] = np.where(np.arange(40) % 3 == 0, np.float32(-0.0), np.float32(0.0))
    expected = sorted(points.tolist(), key=lambda p: (p[2], p[1], p[0]))
    assert resample(points, 60).tolist() == expected


@pytest.mark.parametrize("count", [1, 2, 17, 300])
def test_quantiles_are_those_of_numpy(count):
    rows = np.random.default_rng(0).normal(size=(3, count))
    expected = np.quantile(rows, (0.0, 0.02, 0.5, 1.0), axis=1)
    assert quantiles(rows, (0.0, 0.02, 0.5, 1.0)) == pytest.approx(expected)


def test_thinning_takes_a_subset_and_the_same_one_each_time():
    points = np.arange(30_000, dtype=np.float32).reshape(-1, 3)
    few = thin(points, 100)
    assert len(few) == len(np.unique(few, axis=0)) == 100
    np.testing.assert_array_equal(few, thin(points, 100))
    assert np.isin(few[:, 0], points[:, 0]).all()
