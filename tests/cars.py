# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A car of two boxes and what a sensor that drives past it would see: small, exact, fast."""

import math
from dataclasses import replace

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Track

_BODY = ((-2.1, -0.85, -0.6), (2.1, 0.85, 0.1))
_CABIN = ((-1.6, -0.75, 0.1), (0.6, 0.75, 0.75))


def _surface(low, high, count, rng):
    """Points on a box's faces, by area, and their outward normals."""
    low, high = np.asarray(low), np.asarray(high)
    size = high - low
    areas = np.repeat([size[1] * size[2], size[0] * size[2], size[0] * size[1]], 2)
    face = rng.choice(6, size=count, p=areas / areas.sum())
    axis, side = face // 2, face % 2
    points = low + rng.random((count, 3)) * size
    points[np.arange(count), axis] = np.where(side, high[axis], low[axis])
    normals = np.zeros((count, 3))
    normals[np.arange(count), axis] = 2 * side - 1
    return points, normals


def car_surface(count=4000, seed=0):
    """Points and normals `(count, 3)` in the object frame, x forward, z up, metres."""
    rng = np.random.default_rng(seed)
    body = _surface(*_BODY, count - count // 3, rng)
    cabin = _surface(*_CABIN, count // 3, rng)
    order = rng.permutation(count)
    points, normals = (np.concatenate(pair)[order] for pair in zip(body, cabin, strict=True))
    return points, normals


def drive_by(name="drive", scans=11, step=1.0, points=400, heading=0.1, side=6.0, seed=0):
    """A parked car passed on a straight road: its faces turned to the sensor, 1 cm of noise."""
    rng = np.random.default_rng(seed)
    yaw = torch.full((scans,), heading, dtype=torch.float64)
    x = 12.0 - step * torch.arange(scans, dtype=torch.float64)
    translation = torch.stack((x, torch.full_like(x, side), torch.full_like(x, -1.0)), dim=1)
    poses = SE3(rotation_z(yaw), translation)
    made = []
    for i in range(scans):
        surface, normals = car_surface(6 * points, seed=seed * 1000 + i)
        R, t = poses[i].rotation.numpy(), poses[i].translation.numpy()
        at = surface @ R.T + t
        facing = ((normals @ R.T) * at).sum(axis=1) < 0
        seen = at[facing][:points] + rng.normal(scale=0.01, size=at[facing][:points].shape)
        made.append(seen.astype(np.float32))
    return Track(
        name=name,
        scans=tuple(made),
        scan_names=tuple(f"{i:06d}" for i in range(scans)),
        category="car",
        T_sensor_object=poses,
        shape=car_surface()[0].astype(np.float32),
    )


def half_turned(track, index):
    """The same track with one scan turned by 180 degrees about its sensor."""
    flip = SE3(
        rotation_z(torch.tensor(math.pi, dtype=torch.float64)), torch.zeros(3, dtype=torch.float64)
    )
    scans = list(track.scans)
    scans[index] = flip.apply_numpy(scans[index])
    poses = [track.T_sensor_object[i] for i in range(len(scans))]
    poses[index] = flip @ poses[index]
    return replace(track, scans=tuple(scans), T_sensor_object=stack(poses))


def poses_of(track):
    """The track's true poses, which it must have."""
    assert track.T_sensor_object is not None
    return track.T_sensor_object


def shape_of(track):
    """The track's shape, which it must have."""
    assert track.shape is not None
    return track.shape


def known(figures):
    """The figures that there are."""
    return {name: value for name, value in figures.items() if value is not None}


def off_surface(points):
    """Distance of points `(n, 3)` in the object frame from the car's nearest face, metres."""
    distances = []
    for low, high in (_BODY, _CABIN):
        middle, half = (np.add(high, low)) / 2, (np.subtract(high, low)) / 2
        beyond = np.abs(points - middle) - half
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        distances.append(np.where(outside > 0, outside, -beyond.max(axis=1)))
    return np.min(distances, axis=0)
