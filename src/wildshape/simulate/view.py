# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Depth images of one object from random sides, as points (the setting of DPC)."""

import numpy as np

from wildshape.simulate.raycast import Scene
from wildshape.simulate.sensor import DepthCamera


def random_pose(camera: DepthCamera, rng: np.random.Generator) -> np.ndarray:
    """`(4, 4)` T_object_camera, looking at the origin from a random side, upright."""
    azimuth = rng.uniform(0, 2 * np.pi)
    low, high = np.radians(camera.elevation_deg)
    elevation = rng.uniform(low, high)
    flat = np.cos(elevation)
    back = np.array((flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)))
    forward = -back
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.stack((right, np.cross(forward, right), forward), 1)
    T[:3, 3] = camera.distance * back
    return T


def depth_image(scene: Scene, camera: DepthCamera, T_object_camera: np.ndarray) -> np.ndarray:
    """`(size, size)` float64 depth along the optical axis; infinite where nothing is.

    One ray through each pixel's centre: row v, column u, `(u + 0.5 - cx) / fx`.
    """
    step = (np.arange(camera.size) + 0.5 - camera.center_px) / camera.focal_px
    x, y = np.meshgrid(step, step)
    rays = np.stack((x, y, np.ones_like(x)), -1).reshape(-1, 3)
    length = np.linalg.norm(rays, axis=1)
    toward = np.einsum("ij,nj->ni", T_object_camera[:3, :3], rays / length[:, None])
    hits = scene.cast(np.broadcast_to(T_object_camera[:3, 3], toward.shape), toward)
    return (hits.distance / length).reshape(camera.size, camera.size)


def back_project(depth: np.ndarray, camera: DepthCamera) -> np.ndarray:
    """`(n, 3)` float32 points of the finite pixels: x right, y down, z forward."""
    v, u = np.nonzero(np.isfinite(depth))
    z = depth[v, u]
    x = (u + 0.5 - camera.center_px) / camera.focal_px * z
    y = (v + 0.5 - camera.center_px) / camera.focal_px * z
    return np.stack((x, y, z), -1).astype(np.float32)


def view(
    scene: Scene, camera: DepthCamera, noise: float, dropout: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points `(n, 3)` in the camera frame and `(4, 4)` T_object_camera of a random view."""
    T_object_camera = random_pose(camera, rng)
    depth = depth_image(scene, camera, T_object_camera)
    depth += noise * rng.standard_normal(depth.shape)
    depth[rng.random(depth.shape) < dropout] = np.inf
    return back_project(depth, camera), T_object_camera
