# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The way of the sensor through a drive, by LiDAR odometry.

KISS-ICP: Vizzo et al., RA-L 2023. Rings of a level sensor on a flat road look the same wherever it
stands and hold the odometry back, so ground is used near the sensor alone, for height and tilt.
"""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import DriveConfig, TrajectoryConfig
from wildshape.drives.ground import height_above_ground
from wildshape.drives.mounting import Mounting
from wildshape.drives.source import Drive
from wildshape.errors import MissingExtraError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import STANDING, Twist
from wildshape.records import Points

if TYPE_CHECKING:
    from kiss_icp.kiss_icp import KissICP

_FEWEST_POINTS = 100
_FIRST_SCANS = 3  # tell the motion at the beginning


def find_trajectory(
    drive: Drive,
    mounting: Mounting,
    config: DriveConfig,
    at: Callable[[int], None] = lambda _: None,
) -> SE3:
    """`T_world_sensor` of every frame; the world is the sensor frame of the first.

    Poses that came with the drive are taken as they are. Scans whose points have times are
    corrected by the motion just before them, the first ones by that of a first try. A scan of
    hardly any points goes on as the one before it went.

    Args:
        drive: its scans are read one by one.
        mounting: of its sensor.
        config: see there.
        at: told how many scans are done.

    Raises:
        MissingExtraError: KISS-ICP is not installed.
    """
    if drive.T_world_sensor is not None:
        return drive.T_world_sensor[0].inverse() @ drive.T_world_sensor
    motion = STANDING
    if drive.turn(0).seconds is not None:
        _, motion = _follow(drive, range(min(len(drive), _FIRST_SCANS)), mounting, config, motion)
    poses, _ = _follow(drive, range(len(drive)), mounting, config, motion, at)
    return SE3.from_matrix(np.linalg.inv(poses[0]) @ np.stack(poses))


def _follow(
    drive: Drive,
    frames: range,
    mounting: Mounting,
    config: DriveConfig,
    motion: Twist,
    at: Callable[[int], None] = lambda _: None,
) -> tuple[list[Float[np.ndarray, "4 4"]], Twist]:
    """Poses of the first frames, and the motion after them; `motion`: before them."""
    odometry = _odometry(config.trajectory)
    poses = []
    for frame in frames:
        if frame and _steps_differ(drive, frame):
            odometry.last_delta = motion.after(_seconds(drive, frame)).matrix.numpy()
        scan = _landmarks(drive.turn(frame).carried(motion), mounting, config)
        if len(scan) < _FEWEST_POINTS:
            odometry.last_pose = odometry.last_pose @ odometry.last_delta
        else:
            odometry.register_frame(scan.astype(np.float64), np.zeros(len(scan)))
        if frame:
            step = SE3.from_matrix(odometry.last_delta)
            motion = Twist.between(SE3.identity(), step, _seconds(drive, frame))
        poses.append(odometry.last_pose.copy())
        at(frame + 1)
    return poses, motion


def _seconds(drive: Drive, frame: int) -> float:
    """Since the frame before; scans, where no times are known."""
    at = drive.times or drive.ticks
    return float(at[frame] - at[frame - 1])


def _steps_differ(drive: Drive, frame: int) -> bool:
    """Whether KISS-ICP's guess, the last step once more, does not hold: the first, or at gaps."""
    if frame == 1:
        return True
    before, now = np.diff(drive.ticks[frame - 2 : frame + 1])
    return bool(now != before)


def _landmarks(scan: Points, mounting: Mounting, config: DriveConfig) -> Points:
    """What stands on the ground, and the ground near the sensor."""
    level = mounting.level(scan)
    heights = height_above_ground(level, mounting.height_m, config.ground)
    near = np.hypot(level[:, 0], level[:, 1]) < config.trajectory.ground_m
    return scan[near | (heights > config.trajectory.standing_m)]


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
    settings.registration.max_num_threads = 1  # the same scans give the same way to the last bit
    settings.data.deskew = False  # done before, as for all other stages
    settings.data.min_range, settings.data.max_range = config.nearest_m, config.range_m
    settings.mapping.voxel_size = config.voxel_m
    return KissICP(settings)
