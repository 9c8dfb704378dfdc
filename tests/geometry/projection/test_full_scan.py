# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which rays of a frame lie beside an object, against all rays looked at one by one."""

import numpy as np
import pytest

from wildshape.geometry.projection.full_scan import FullScan, _Frustum, sight_lines


def in_the_frustum(frame: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Every ray of a frame in axes towards the object; rows."""
    points = frame[own].astype(np.float64)
    away = np.linalg.norm(points, axis=1)
    ahead = (points / away[:, None]).mean(0)
    ahead /= np.linalg.norm(ahead)
    left = np.cross((0.0, 0.0, 1.0), ahead)
    left /= np.linalg.norm(left)

    def angles(cloud):
        x, y, z = cloud @ ahead, cloud @ left, cloud @ np.cross(ahead, left)
        return np.stack((np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))), axis=1), x

    own_angles, _ = angles(points)
    seen, x = angles(frame.astype(np.float64))
    wide = 1 / max(away.min(), 1.0)
    inside = (seen >= own_angles.min(0) - wide) & (seen <= own_angles.max(0) + wide)
    found = inside.all(1) & (x > 0) & frame.any(1)
    found[own] = False
    return np.flatnonzero(found)


@pytest.mark.parametrize(
    ("middle", "half"),
    [
        ((-12.0, 0.5, 0.0), (1.0, 1.0, 0.7)),  # where azimuths begin anew
        ((9.0, -6.0, -1.5), (2.0, 1.0, 0.8)),
        ((0.5, 4.0, -2.5), (0.8, 0.8, 0.8)),  # steep
        ((1.0, 1.5, -0.5), (1.2, 1.2, 1.0)),  # it reaches around the sensor
        ((-30.0, -2.0, 8.0), (2.0, 5.0, 2.0)),
    ],
)
def test_rays_beside_an_object_are_those_in_its_frustum(middle, half):
    frame = np.random.default_rng(0).uniform(-35, 35, (40_000, 3)).astype(np.float32)
    frame[::7] *= 0.2
    frame[::1000] = 0.0
    own = np.flatnonzero((np.abs(frame - np.float32(middle)) < half).all(1) & frame.any(1))
    assert len(own) > 0
    full = FullScan(frame)
    expected = in_the_frustum(frame, own)
    assert len(expected) > 50
    assert full.near(own, most=10**6).tolist() == expected.tolist()
    some = full.near(own, most=50)
    assert len(some) == 50
    assert (np.diff(some) > 0).all()
    assert set(some) <= set(expected)


def test_rays_beside_an_object_far_overhead_are_those_in_its_frustum():
    """Steeper than 64 degrees axes towards an object are rolled against the sensor's."""
    middle = np.array((12.3, -4.0, 27.4))
    frame = (middle + np.random.default_rng(0).uniform(-6, 6, (40_000, 3))).astype(np.float32)
    own = np.flatnonzero((np.abs(frame - frame.mean(0)) < (2.0, 0.5, 0.5)).all(1))
    expected = np.setdiff1d(_Frustum.around(frame[own]).rows_within(frame), own)
    assert len(expected) > 50
    assert FullScan(frame).near(own, most=10**6).tolist() == expected.tolist()


def test_rays_that_did_not_come_back_and_where_rays_began_are_kept():
    points = np.array([[10.0, 0, 0], [20.0, 1, 0], [9.0, -0.5, 0], [-9.0, 0, 0]], np.float32)
    starts = np.array([[0.0, 1, 0]] * 4, np.float32)
    own, lost = np.array([0]), np.array([[1.0, 0.0, 0.05]], np.float32)
    rays = sight_lines(FullScan(points, lost=lost), own)
    assert rays is not None
    assert np.isinf(rays.ranges).tolist() == [False, False, True]
    moved = sight_lines(FullScan(points, starts), own)
    assert moved is not None
    assert moved.origins is not None
    assert moved.origins.tolist() == [[0, 1, 0], [0, 1, 0]]
    assert np.allclose(moved.ends, points[[1, 2]])
    both = sight_lines(FullScan(points, starts[[0] * 5], lost), own)
    assert both is not None
    assert both.starts.tolist() == [[0, 1, 0]] * 3
    assert np.allclose(both.directions[2], lost[0] / np.linalg.norm(lost[0]))
    assert sight_lines(FullScan(points), own[:0]) is None
