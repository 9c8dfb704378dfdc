# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The way of the sensor through a drive, by LiDAR odometry.

KISS-ICP: Vizzo et al., RA-L 2023.
"""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from wildshape.drives.config import TrajectoryConfig
from wildshape.drives.source import Drive
from wildshape.errors import MissingExtraError
from wildshape.geometry.transforms.se3 import SE3

if TYPE_CHECKING:
    from kiss_icp.kiss_icp import KissICP

_FEWEST_POINTS = 100


def find_trajectory(
    drive: Drive, config: TrajectoryConfig, at: Callable[[int], None] = lambda _: None
) -> SE3:
    """`T_world_sensor` of every frame; the world is the sensor frame of the first.

    Poses that came with the drive are taken as they are. A scan of hardly any points goes on as
    the one before it went.

    Args:
        drive: its scans are read one by one.
        config: see there.
        at: told how many scans are done.

    Raises:
        MissingExtraError: KISS-ICP is not installed.
    """
    if drive.T_world_sensor is not None:
        return drive.T_world_sensor[0].inverse() @ drive.T_world_sensor
    odometry = _odometry(config)
    poses = []
    for frame in range(len(drive)):
        scan = drive.scan(frame)
        if len(scan) < _FEWEST_POINTS:
            odometry.last_pose = odometry.last_pose @ odometry.last_delta
        else:
            odometry.register_frame(scan.astype(np.float64), np.zeros(len(scan)))
        poses.append(odometry.last_pose.copy())
        at(frame + 1)
    return SE3.from_matrix(np.linalg.inv(poses[0]) @ np.stack(poses))


def jumps(T_world_sensor: SE3, ticks: tuple[int, ...], config: TrajectoryConfig) -> Iterator[int]:
    """The frames that no vehicle reaches from the two before them."""
    steps = np.diff(T_world_sensor.translation.numpy(), axis=0) / np.diff(ticks)[:, None]
    changes = np.linalg.norm(np.diff(steps, axis=0), axis=1)
    yield from (np.flatnonzero(changes > config.jump_m) + 2).tolist()


def _odometry(config: TrajectoryConfig) -> "KissICP":
    try:
        from kiss_icp.config import load_config
        from kiss_icp.kiss_icp import KissICP
    except ImportError as error:
        raise MissingExtraError(
            "the sensor's way is found by KISS-ICP, which is not installed: pip install kiss-icp,"
            " or give a poses.txt beside the scans."
        ) from error
    settings = load_config(None)
    settings.data.deskew = False  # the files hold no time of each point
    settings.data.min_range, settings.data.max_range = config.nearest_m, config.range_m
    settings.mapping.voxel_size = config.voxel_m
    return KissICP(settings)
