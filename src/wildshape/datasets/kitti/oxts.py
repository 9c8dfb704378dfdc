# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI's GPS/IMU records as poses in a frame that does not move."""

import math
from pathlib import Path

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3

_EARTH_RADIUS_M = 6378137.0
_COUNT = 30
_NORTHMOST = 89.0  # degrees: at a pole Mercator's map has no end


def read_oxts(path: Path) -> SE3:
    """`T_world_imu`, one a line: east, north, up as the Mercator map has them, from the first on.

    Raises:
        BadInputError: a line has not the 30 numbers of KITTI's GPS/IMU records.
    """
    rows = []
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), start=1):
        try:
            row = [float(word) for word in line.split()[:6]]
        except ValueError:
            row = []
        whole = len(row) == 6 and len(line.split()) == _COUNT and all(map(math.isfinite, row))
        if not whole or abs(row[0]) >= _NORTHMOST:
            raise BadInputError(
                f"{path}, line {number}: expected {_COUNT} numbers (lat lon alt roll pitch yaw "
                "...); the file is damaged, download KITTI's GPS/IMU data again."
            )
        rows.append(row)
    if not rows:
        raise BadInputError(f"{path}: is empty; download KITTI's GPS/IMU data again.")
    return poses_of(np.asarray(rows))


def poses_of(records: np.ndarray) -> SE3:
    """`T_world_imu` of records `(n, 6)`: degrees, metres, radians as in the files."""
    latitude, longitude, altitude, roll, pitch, yaw = records.T
    scale = math.cos(math.radians(latitude[0])) * _EARTH_RADIUS_M
    east = scale * np.radians(longitude)
    north = scale * np.log(np.tan(np.radians(90 + latitude) / 2))
    places = np.stack((east, north, altitude), axis=1)
    rotation = _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)
    return SE3(torch.from_numpy(rotation), torch.from_numpy(places - places[0]))


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """Rotations `(n, 3, 3)` about an axis."""
    rotation = np.zeros((len(angle), 3, 3))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    rotation[:, axis, axis] = 1
    rotation[:, a, a] = rotation[:, b, b] = np.cos(angle)
    rotation[:, b, a] = np.sin(angle)
    rotation[:, a, b] = -np.sin(angle)
    return rotation
