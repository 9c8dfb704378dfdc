# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Depth views: exact back-projection, the stated intrinsics, the object within the image."""

import numpy as np
import pytest

from wildshape.geometry.projection.pinhole import back_project
from wildshape.simulate.one_track import depth_image, random_pose, view
from wildshape.simulate.raycast import Scene
from wildshape.simulate.sensor import DEPTH_CAMERA
from wildshape.simulate.shapes.solid import box, ellipsoid
from wildshape.simulate.shapes.unit_shapes import airplane


def test_back_projection_is_exact_on_a_plane() -> None:
    plane = box((-5.0, -5.0, 2.0), (5.0, 5.0, 3.0))
    depth = depth_image(Scene([plane]), DEPTH_CAMERA, np.eye(4))
    np.testing.assert_allclose(depth, 2.0, atol=1e-5)
    points = back_project(depth, DEPTH_CAMERA.intrinsics).astype(np.float64)
    assert len(points) == 128 * 128
    u = 240.0 * points[:, 0] / points[:, 2] + 64.0
    v = 240.0 * points[:, 1] / points[:, 2] + 64.0
    row, column = np.divmod(np.arange(128 * 128), 128)
    np.testing.assert_allclose(u, column + 0.5, atol=1e-4)
    np.testing.assert_allclose(v, row + 0.5, atol=1e-4)


def test_a_unit_sphere_of_directions_fits_and_fills_the_image() -> None:
    """A sphere of diameter 1 at distance 2 reaches 0.484 of the half width 0.5."""
    edge = 0.5 / np.sqrt(2.0**2 - 0.5**2) * DEPTH_CAMERA.focal_px
    assert 0.9 * 64 < edge < 64


def test_views_are_from_elevations_as_stated() -> None:
    rng = np.random.default_rng(0)
    at = np.array([random_pose(DEPTH_CAMERA, rng)[:3, 3] for _ in range(400)])
    elevation = np.degrees(np.arcsin(at[:, 2] / np.linalg.norm(at, axis=1)))
    low, high = DEPTH_CAMERA.elevation_deg
    assert low <= elevation.min() < low + 3
    assert high - 3 < elevation.max() <= high


def test_noise_and_losses_of_a_view_are_as_stated() -> None:
    ball = Scene([ellipsoid((0.0, 0.0, 0.0), (0.4, 0.4, 0.4))])
    clean, lost, noisy = (
        view(ball, DEPTH_CAMERA, *how, np.random.default_rng(0))[0]
        for how in ((0.0, 0.0), (0.0, 0.3), (0.01, 0.0))
    )
    assert len(lost) == pytest.approx(0.7 * len(clean), rel=0.05)
    assert (noisy[:, 2] - clean[:, 2]).std() == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_views_look_upright_at_the_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = random_pose(DEPTH_CAMERA, rng)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(T[:3, 3] + 2.0 * T[:3, 2], 0.0, atol=1e-12)
    assert T[2, 1] < 0  # the image's down is the world's down
    solid = airplane(rng)
    points, T_object_camera = view(Scene([solid]), DEPTH_CAMERA, 0.0, 0.0, rng)
    on_object = points @ T_object_camera[:3, :3].T + T_object_camera[:3, 3]
    assert (np.abs(on_object) <= solid.bounds[1] + 1e-4).all()
    assert len(points) > 300
