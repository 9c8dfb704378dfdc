# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drive-bys: where the sensor is at each scan, seen from the parked object."""

from dataclasses import dataclass

import numpy as np

from wildshape.geometry.transforms.rotation import rotations_about

_RATE_HZ = 10.0
_CLEARANCE_M = 0.8  # between the sensor's way and the object's box


@dataclass(frozen=True)
class Drive:
    """One pass, in a world frame with z up and the road at z = 0.

    Attributes:
        kind: `straight`, `bend` or `turn`.
        T_object_sensor: `(v, 4, 4)` in time order; the object's frame has its origin
            at its box centre, x forward, y left, z up.
    """

    kind: str
    T_object_sensor: np.ndarray


def drive_by(
    height: float, half: np.ndarray, near: float, far: float, rng: np.random.Generator
) -> Drive:
    """A random pass of a sensor along a parked object.

    Straight (45 %), a bend of constant curvature (30 %) or a 90-degree turn (25 %); passing at
    2.5-12 m to the side, 3-12 m/s; the object stands along the road (45 %),
    against it (35 %) or across (20 %), each +-8 degrees.

    Args:
        height: of the sensor above the road, metres.
        half: `(3,)` half lengths of the object's box, metres: its centre is half[2] above the
            road.
        near: smallest range of the object's centre, metres.
        far: largest range, metres.
        rng: the only source of chance.

    Returns:
        All scan poses within the ranges; possibly none.
    """
    kind = str(rng.choice(("straight", "bend", "turn"), p=(0.45, 0.30, 0.25)))
    speed = float(rng.uniform(3.0, 12.0))
    s = np.arange(-45.0, 45.0, speed / _RATE_HZ) + rng.uniform(0, speed / _RATE_HZ)
    path = _path(kind, s, rng)
    place = _beside(path, kind, rng)
    yaw = place[2]
    turn = np.array(((np.cos(yaw), -np.sin(yaw), 0), (np.sin(yaw), np.cos(yaw), 0), (0, 0, 1)))
    T_object_world = np.eye(4)
    T_object_world[:3, :3] = turn.T
    T_object_world[:3, 3] = -turn.T @ (place[0], place[1], half[2])
    T_object_sensor = T_object_world @ _sensor_poses(path, height, rng)
    at = T_object_sensor[:, :2, 3]
    clear = bool((np.abs(at) - half[:2]).max(1).min() > _CLEARANCE_M)
    distance = np.linalg.norm(at, axis=1)
    keep = (distance >= near) & (distance <= far) & clear
    return Drive(kind, T_object_sensor[keep])


def _path(kind: str, s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """`(n, 3)` x, y, yaw at arc lengths s (metres); the object will stand near s = 0."""
    sign = rng.choice((-1.0, 1.0))
    if kind == "straight":
        curvature = np.zeros_like(s)
    elif kind == "bend":
        curvature = np.full_like(s, sign / rng.uniform(20.0, 80.0))
    else:
        radius = rng.uniform(6.0, 12.0)
        begin = rng.uniform(-0.5 * np.pi * radius - 6.0, 6.0)
        curvature = np.where((s > begin) & (s < begin + 0.5 * np.pi * radius), sign / radius, 0.0)
    step = np.gradient(s)
    yaw = np.cumsum(curvature * step)
    yaw -= np.interp(0.0, s, yaw)
    x, y = np.cumsum(np.cos(yaw) * step), np.cumsum(np.sin(yaw) * step)
    return np.stack((x - np.interp(0.0, s, x), y - np.interp(0.0, s, y), yaw), -1)


def _beside(path: np.ndarray, kind: str, rng: np.random.Generator) -> np.ndarray:
    """The object's x, y, yaw: to the side of s = 0, where the path is at the origin, yaw 0."""
    offset = rng.choice((-1.0, 1.0)) * (2.5 + 9.5 * rng.beta(1.3, 2.2))
    if kind == "turn" and rng.random() < 0.5:
        offset = -abs(offset) * np.sign(path[-1, 2] - path[0, 2])
    headings = (0.0, np.pi, rng.choice((-0.5, 0.5)) * np.pi)
    yaw = rng.choice(headings, p=(0.45, 0.35, 0.20)) + np.radians(rng.uniform(-8.0, 8.0))
    return np.array((0.0, offset, yaw))


def _sensor_poses(path: np.ndarray, height: float, rng: np.random.Generator) -> np.ndarray:
    """`(v, 4, 4)` T_world_sensor with a vehicle's small pitch, roll and heave."""
    v = len(path)
    pitch, roll = np.radians(rng.normal(0.0, (0.4, 0.3), (v, 2))).T
    yaw = path[:, 2] + np.radians(rng.normal(0.0, 0.2, v))
    T = np.tile(np.eye(4), (v, 1, 1))
    T[:, :3, :3] = rotations_about(2, yaw) @ rotations_about(1, pitch) @ rotations_about(0, roll)
    T[:, :2, 3] = path[:, :2]
    T[:, 2, 3] = height + rng.normal(0.0, 0.01, v)
    return T
