# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track number i of a simulation: a LiDAR driven past, or a depth camera set around (as of DPC).

It depends on (seed, i) alone, and is numpy only, so that workers start fast.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.projection.pinhole import back_project
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.occluder import occluders
from wildshape.simulate.raycast import Scene
from wildshape.simulate.scan import Backdrop, Returns, Turn, passing_rays, scan
from wildshape.simulate.sensor import DepthCamera, SpinningLidar
from wildshape.simulate.shapes.meshes import read_mesh
from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.shapes.unit_shapes import airplane, chair
from wildshape.simulate.shapes.variety import varied
from wildshape.simulate.shapes.vehicle import random_vehicle, varied_vehicle
from wildshape.simulate.trajectory import drive_by
from wildshape.simulate.truth import visible_surface
from wildshape.simulate.varied_scans import cut_above_ground, varied_returns

_ATTEMPTS = 60
_WALLED, _WALL_OFFSET_M, _WALL_HEIGHT_M = 0.7, (2.0, 20.0), (1.0, 8.0)


@dataclass(frozen=True)
class RawTrack:
    """A track before it becomes a record.

    Attributes:
        scans: `(n_i, 3)` float32, metres, sensor frame.
        T_object_sensor: `(v, 4, 4)` float64.
        shape: `(g, 3)` float32, object frame.
        kind: what the object is.
        rays: of each scan, if they are asked for.
    """

    scans: list[np.ndarray]
    T_object_sensor: np.ndarray
    shape: np.ndarray
    kind: str
    rays: tuple[SightLines | None, ...] = ()


@dataclass(frozen=True)
class Job:
    """A whole simulation.

    Attributes:
        seed: of all chance.
        meshes: the user's files, or empty for our own shapes.
    """

    config: SimulationConfig
    seed: int
    meshes: tuple[Path, ...]

    def track(self, index: int) -> RawTrack:
        """Simulate one track.

        Raises:
            BadInputError: a mesh that cannot be used.
        """
        config = self.config
        rng = np.random.default_rng([self.seed, index])
        target = self._target(index, rng)
        scans = config.usual_scans
        if config.vary_scans:
            scans = int(rng.integers(max(scans // 2, 1), scans * 5 // 3 + 1))
        glass = float(rng.uniform(0.02, 0.3))
        returns = Returns(config.noise, config.loss, glass, config.ground)
        if config.varied:
            returns = varied_returns(returns, rng)
        if isinstance(config.device, DepthCamera):
            return _camera_track(target, config, config.device, scans, returns, rng)
        chance = np.random.default_rng([self.seed, index, 1])
        return _lidar_track(target, config, config.device, scans, returns, rng, chance)

    def _target(self, index: int, rng: np.random.Generator) -> Solid:
        lidar = self.config.is_lidar
        if self.meshes:
            mesh = read_mesh(self.meshes[index % len(self.meshes)], metres=lidar)
            return varied(mesh, rng) if self.config.varied else mesh
        car = varied_vehicle if self.config.varied else random_vehicle
        makers = {"car": car, "airplane": airplane, "chair": chair}
        return makers[self.config.shown](rng).centred(None if lidar else 1.0)


def _lidar_track(
    target: Solid,
    config: SimulationConfig,
    lidar: SpinningLidar,
    scans: int,
    returns: Returns,
    rng: np.random.Generator,
    of_rays: np.random.Generator,
) -> RawTrack:
    """Drive past an object, again if need be, until enough usable scans are together.

    The truth shape is what can be seen from a point's own height or higher: a LiDAR on a road
    sees every wall down to the ground, but no car's underside. `of_rays` is the source of chance
    of the rays that passed by, if they are wanted: the scans stay as they are.
    """
    occluded = bool(rng.random() < config.occluded)
    alone = Scene([target])
    shape = visible_surface(target, alone, config.shape_points, 0.0, rng)
    height = lidar.height_m + rng.normal(0.0, 0.03)
    for attempt in range(_ATTEMPTS):
        far = max(config.far_m * 0.96**attempt, 2 * config.near_m)
        poses = drive_by(height, target.bounds[1], config.near_m, far, rng).T_object_sensor
        poses = _stretch(poses, scans, config.whole_pass, rng)
        scene = alone
        if occluded and len(poses):
            scene = Scene([target, *occluders(target, poses[:scans, :3, 3], rng)])
        usable: list[tuple[Turn, np.ndarray]] = []
        for left, T_object_sensor in zip(range(len(poses), 0, -1), poses):
            if len(usable) + left < scans:
                break
            turn = scan(scene, target, lidar, T_object_sensor, returns, rng)
            if config.varied:
                turn = cut_above_ground(turn, T_object_sensor, target, rng)
            if turn.on_target >= config.min_points:
                usable.append((turn, T_object_sensor))
            if len(usable) == scans:
                clouds, used = [turn.points for turn, _ in usable], np.stack([T for _, T in usable])
                wall = _backdrop(of_rays) if config.varied else None
                passed = tuple(
                    passing_rays(scene, target, lidar, T, returns, turn, config.rays, of_rays, wall)
                    for turn, T in (usable if config.rays else ())
                )
                return RawTrack(clouds, used, shape, target.kind, passed)
    raise BadInputError(
        f"the object {target.kind or 'given'} gives no {scans} scans of >= {config.min_points} "
        f"points to {lidar.name} within {config.far_m:g} m: it is too small, not in metres, or "
        "ask for fewer scans."
    )


def _backdrop(rng: np.random.Generator) -> Backdrop | None:
    """For training a hedge or a house beyond the object, more often than not."""
    if rng.random() >= _WALLED:
        return None
    return Backdrop(float(rng.uniform(*_WALL_OFFSET_M)), float(rng.uniform(*_WALL_HEIGHT_M)))


def _stretch(
    poses: np.ndarray, scans: int, whole_pass: float, rng: np.random.Generator
) -> np.ndarray:
    """A random stretch of a drive, from which the scans are taken; empty if it is too short."""
    longest = len(poses) // scans
    if longest == 0:
        return poses[:0]
    stride = longest if rng.random() < whole_pass else 1
    spare = len(poses) - stride * scans
    return poses[int(rng.integers(0, spare + 1)) :: stride]


def _camera_track(
    target: Solid,
    config: SimulationConfig,
    camera: DepthCamera,
    scans: int,
    returns: Returns,
    rng: np.random.Generator,
) -> RawTrack:
    """Depth views from random sides; the truth shape is what is seen from anywhere."""
    scene = Scene([target])
    shape = visible_surface(target, scene, config.shape_points, -90.0, rng)
    usable: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(scans + _ATTEMPTS):
        points, T_object_camera = view(scene, camera, returns.noise_m, returns.dropout, rng)
        if len(points) >= config.min_points:
            usable.append((points, T_object_camera))
        if len(usable) == scans:
            clouds, poses = zip(*usable)
            return RawTrack(list(clouds), np.stack(poses), shape, target.kind)
    raise BadInputError(
        f"the object {target.kind or 'given'} shows fewer than {config.min_points} points a view: "
        "it is too thin; check the mesh."
    )


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


def view(
    scene: Scene, camera: DepthCamera, noise: float, dropout: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points `(n, 3)` in the camera frame and `(4, 4)` T_object_camera of a random view."""
    T_object_camera = random_pose(camera, rng)
    depth = depth_image(scene, camera, T_object_camera)
    depth += noise * rng.standard_normal(depth.shape)
    depth[rng.random(depth.shape) < dropout] = np.inf
    return back_project(depth, camera.intrinsics), T_object_camera
