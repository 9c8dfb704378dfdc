# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where the velodyne of a KITTI raw drive stood in the world, for telling parked from moving."""

from pathlib import Path

import numpy as np
import torch

from wildshape.datasets.kitti.oxts import poses_of
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3

_OXTS, _CALIBRATION = "oxts/data", "calib_imu_to_velo.txt"
_NUMBERS = 30


def world_poses(drive: Path) -> dict[int, SE3]:
    """`T_world_velo` of each frame; the world is level, its origin the first frame's IMU.

    Raises:
        BadInputError: the GPS/IMU records or their calibration are missing or damaged.
    """
    files = sorted((drive / _OXTS).glob("*.txt"))
    if not files:
        raise BadInputError(
            f"{drive / _OXTS}: no records; whether an object moves needs the GPS/IMU data that"
            " KITTI's 'synced+rectified' archive of the drive brings."
        )
    T_world_imu = poses_of(np.stack([_record(file) for file in files]))
    T_world_velo = T_world_imu @ _T_velo_imu(drive.parent / _CALIBRATION).inverse()
    return {int(file.stem): T_world_velo[i] for i, file in enumerate(files)}


def _record(path: Path) -> np.ndarray:
    """Latitude, longitude, altitude, roll, pitch, yaw."""
    words = path.read_text(errors="replace").split()
    try:
        numbers = np.asarray([float(word) for word in words[:6]])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != 6 or len(words) != _NUMBERS or not np.isfinite(numbers).all():
        raise BadInputError(
            f"{path}: expected {_NUMBERS} numbers (lat lon alt roll pitch yaw ...); the file is"
            " damaged, download the drive again."
        )
    return numbers


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
