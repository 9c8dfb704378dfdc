# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI's GPS/IMU records as poses in a frame that does not move: of a sequence, and of a drive."""

import math
from pathlib import Path

import numpy as np
import torch

from wildshape.datasets.tracks.parts import numbered
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotations_about
from wildshape.geometry.transforms.se3 import SE3

_EARTH_RADIUS_M = 6378137.0
_COUNT = 30
_OXTS, _CALIBRATION = "oxts/data", "calib_imu_to_velo.txt"
_NORTHMOST = 89.0  # degrees: at a pole Mercator's map has no end


def read_oxts(path: Path) -> SE3:
    """`T_world_imu`, one a line: east, north, up as the Mercator map has them, from the first on.

    Raises:
        BadInputError: a line has not the 30 numbers of KITTI's GPS/IMU records.
    """
    lines = path.read_text(errors="replace").splitlines()
    rows = [_record(line, f"{path}, line {number}") for number, line in enumerate(lines, start=1)]
    if not rows:
        raise BadInputError(f"{path}: is empty; download KITTI's GPS/IMU data again.")
    return poses_of(np.asarray(rows))


def drive_poses(drive: Path) -> dict[int, SE3]:
    """`T_world_velo` of each frame of a raw drive; the world is level, its origin the first IMU.

    Raises:
        BadInputError: the GPS/IMU records or their calibration are missing or damaged.
    """
    none = (
        "no records; whether an object moves needs the GPS/IMU data that KITTI's 'synced+rectified'"
        " archive of the drive brings"
    )
    files = numbered(drive / _OXTS, ".txt", none)
    rows = [_record(file.read_text(errors="replace"), f"{file}") for file in files.values()]
    T_world_velo = poses_of(np.asarray(rows)) @ _T_velo_imu(drive.parent / _CALIBRATION).inverse()
    return dict(zip(files, T_world_velo))


def _record(text: str, where: str) -> list[float]:
    """Latitude, longitude, altitude, roll, pitch, yaw."""
    words = text.split()
    try:
        row = [float(word) for word in words[:6]]
    except ValueError:
        row = []
    whole = len(row) == 6 and len(words) == _COUNT and all(map(math.isfinite, row))
    if not whole or abs(row[0]) >= _NORTHMOST:
        raise BadInputError(
            f"{where}: expected {_COUNT} numbers (lat lon alt roll pitch yaw ...); the file is"
            " damaged, download KITTI's GPS/IMU data again."
        )
    return row


def poses_of(records: np.ndarray) -> SE3:
    """`T_world_imu` of records `(n, 6)`: degrees, metres, radians as in the files."""
    latitude, longitude, altitude, roll, pitch, yaw = records.T
    scale = math.cos(math.radians(latitude[0])) * _EARTH_RADIUS_M
    east = scale * np.radians(longitude)
    north = scale * np.log(np.tan(np.radians(90 + latitude) / 2))
    places = np.stack((east, north, altitude), axis=1)
    rotation = rotations_about(2, yaw) @ rotations_about(1, pitch) @ rotations_about(0, roll)
    return SE3(torch.from_numpy(rotation), torch.from_numpy(places - places[0]))


def _T_velo_imu(path: Path) -> SE3:  # noqa: N802
    if not path.is_file():
        raise BadInputError(
            f"{path}: no such file; KITTI's 'calibration' archive of the date brings it."
        )
    lines = (line.partition(":") for line in path.read_text(errors="replace").splitlines())
    entries = {name: rest.split() for name, _, rest in lines}
    try:
        R, t = (np.asarray([float(word) for word in entries[name]]) for name in "RT")
        rows = np.column_stack((R.reshape(3, 3), t))
        return SE3.from_matrix(torch.from_numpy(rows))
    except (KeyError, ValueError) as error:
        raise BadInputError(
            f"{path}: expected lines R of 9 numbers, a rotation, and T of 3; download it again."
        ) from error
