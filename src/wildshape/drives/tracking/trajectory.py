# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The way of the sensor through a drive, by LiDAR odometry.

Rings of a level sensor on a flat road look the same wherever it stands and hold the odometry back,
so the ground tells height and tilt alone. So do those of a flat ceiling, of which nothing is used.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from wildshape.drives.config import DriveConfig, LinkConfig, TrajectoryConfig
from wildshape.drives.source import HALF_TICK, Drive
from wildshape.drives.tracking.given_poses import held_back, misfit
from wildshape.drives.tracking.landmarks import Landmarks, landmarks_of
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.tracking.odometry import FEWEST_POINTS, Odometry
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import STANDING, Twist
from wildshape.io.guard import read_record
from wildshape.io.progress import counted
from wildshape.records import Turn

FIRST_SCANS = 3  # tell the motion at the beginning, and whether points have times
_TRIED_SCANS, _TRIED_M = 8, 2.0  # by so many a sensor that seems to stand is tried as a driving one
_GOES_M = 0.5  # a scan; from such a start those that stand came to 0.05 in eight scans


@dataclass(frozen=True)
class Breaks:
    """Where the sensor's way breaks off, and what else is odd about it.

    Attributes:
        frames: whose place could not be told from the frame before.
        misfit: what seems to be wrong with poses that came with the drive, or with the way found.
        untimed: frames whose points have no times that can be used, where others have some.
    """

    frames: tuple[int, ...] = ()
    misfit: str = ""
    untimed: tuple[int, ...] = ()

    @classmethod
    def read(cls, path: Path) -> "Breaks":
        """Of a file; none where there is no file."""
        if not path.is_file():
            return cls()
        return read_record(path, "the breaks of a way", cls)

    def ticks(self, ticks: Sequence[int | float], config: LinkConfig) -> list[int | float]:
        """Ticks with so long a pause at each break that nothing is linked across."""
        apart = config.longest_gap + 1
        before = np.searchsorted(self.frames, np.arange(len(ticks)), side="right")
        return (np.asarray(ticks) + apart * before).tolist()

    def told(self) -> list[str]:
        """A sentence on each that there is."""
        told = [self.misfit] if self.misfit else []
        if self.frames:
            times = counted(len(self.frames), "time")
            told.append(
                f"the sensor's way breaks off {times}, first at frame {self.frames[0]}: that scan"
                " does not fit the one before it; no vehicle is followed across"
            )
        if self.untimed:
            told.append(
                f"times of points that cannot be used in {counted(len(self.untimed), 'scan')},"
                f" first of frame {self.untimed[0]}: not corrected for the sensor's motion"
            )
        return told


@dataclass(frozen=True)
class Way:
    """The way of the sensor.

    Attributes:
        T_world_sensor: `(n,)` of every frame.
        breaks: in it.
    """

    T_world_sensor: SE3
    breaks: Breaks = Breaks()


def find_trajectory(
    drive: Drive,
    mounting: Mounting,
    config: DriveConfig,
    at: Callable[[int], None] = lambda _: None,
    scans: Iterable[Landmarks] | None = None,
) -> Way:
    """The way of the sensor; the world is the sensor frame of the first frame.

    Poses that came with the drive are taken as they are, and looked at. Scans whose points have
    times are corrected by the motion just before them, the first ones by that of a first try. A
    scan that fits the one before badly is tried from longer steps to all sides: a recording may
    begin at speed. A scan of hardly any points goes on as the one before it went, and so does one
    that does not fit the one before.

    Args:
        drive: its scans are read one by one.
        mounting: of its sensor.
        config: see there.
        at: told how many scans are done.
        scans: the landmarks of each frame, in order; by default they are found here.

    Raises:
        MissingExtraError: KISS-ICP is not installed.
    """
    if drive.T_world_sensor is not None:
        breaks = Breaks(misfit=misfit(drive, mounting, config))
        return Way(drive.T_world_sensor[0].inverse() @ drive.T_world_sensor, breaks)
    if scans is None:
        scans = (landmarks_of(drive.turn(frame), mounting, config) for frame in range(len(drive)))
    up = np.array(mounting.up)
    rest = iter(scans)
    begin = list(islice(rest, _TRIED_SCANS))
    first = begin[:FIRST_SCANS]
    motion = STANDING
    if any(scan.standing.seconds is not None for scan in first):  # the first scan may be empty
        motion = _follow(drive, first, config, motion, up)[1].motion
    poses, odometry = _follow(drive, chain(begin, rest), config, motion, up, at)
    T_world_sensor = SE3.from_matrix(np.linalg.inv(poses[0]) @ np.stack(poses))
    untimed = tuple(odometry.untimed) if odometry.timed else ()
    wrong = ""
    if not odometry.lost:
        wrong = held_back(drive, T_world_sensor, mounting, config)
        if not wrong and _far(poses[:FIRST_SCANS]) < _GOES_M:
            wrong = _may_drive(drive, begin, config, up)
    return Way(T_world_sensor, Breaks(tuple(odometry.lost), wrong, untimed))


def _may_drive(
    drive: Drive, scans: list[Landmarks], config: DriveConfig, up: Float[np.ndarray, "3"]
) -> str:
    """A sentence if a sensor that is taken to stand goes on if it is taken to drive.

    What goes along with it, and walls that look alike all along, fit where it stands. The ground
    fits wherever it is taken to be and holds it there.
    """
    if len(scans) < 2 or min(len(scan.standing.points) for scan in scans) < FEWEST_POINTS:
        return ""
    ahead = torch.tensor((_TRIED_M, 0.0, 0.0), dtype=torch.float64)
    step = SE3(torch.eye(3, dtype=torch.float64), ahead)
    driving = Twist.between(SE3.identity(), step, _seconds(drive, 0, 1))
    held = (Landmarks(scan.whole, scan.ground) for scan in scans)
    poses, odometry = _follow(drive, held, config, driving, up)
    if odometry.lost or _far(poses[-2:]) < _GOES_M:
        return ""
    return (
        "the sensor is taken to stand, but its first scans also fit a way ahead, as where all"
        " around goes along or walls are plain: if it drives, give a poses.txt"
    )


def _far(poses: "list[Float[np.ndarray, '4 4']]") -> float:
    """From the first to the last, metres."""
    return float(np.linalg.norm(poses[-1][:3, 3] - poses[0][:3, 3]))


def _follow(
    drive: Drive,
    scans: Iterable[Landmarks],
    config: DriveConfig,
    motion: Twist,
    up: Float[np.ndarray, "3"],
    at: Callable[[int], None] = lambda _: None,
) -> "tuple[list[Float[np.ndarray, '4 4']], Odometry]":
    """Poses of the first frames, and the odometry after them.

    `motion`: of the sensor before them; `up`: the vertical in its frame.

    A turn is followed at its own middle, wherever in it the scan's stamp lies. About its first
    point, an error of the speed would come back in the next step as large, and turned round. A
    step takes half of what a turn lasts at least: stamps may be late. A scan of hardly any points
    is placed, and else left out as if it were missing.
    """
    odometry = Odometry(config.trajectory, motion, up)
    longest = _longest_guess(drive, config.trajectory)
    poses, last, step, before = [], 0, 0, 0.0  # of the last scan followed; before: its middle
    for frame, scan in enumerate(scans):
        turn = scan.standing
        few = len(turn.points) < FEWEST_POINTS
        middle = 0.0 if few else _middle(turn)
        since = _seconds(drive, last, frame) + middle - before
        if few:
            gone_on = odometry.motion.after(min(since, longest)).matrix.numpy()
            poses.append(odometry.kiss.last_pose @ gone_on)
            at(frame + 1)
            continue
        odometry.count(turn, frame)
        since = max(since, _lasts(turn) / 2)
        if drive.ticks[frame] - drive.ticks[last] != step:  # KISS-ICP guesses the last step again
            odometry.expect(min(since, longest))
        ground = _since(scan.ground, middle).carried(odometry.motion)
        odometry.follow(_since(turn, middle).carried(odometry.motion), ground, frame)
        if frame:
            odometry.learn(since)
        pose = odometry.kiss.last_pose.copy()
        poses.append(pose @ odometry.motion.after(-middle).matrix.numpy() if middle else pose)
        last, step, before = frame, drive.ticks[frame] - drive.ticks[last], middle
        at(frame + 1)
    return poses, odometry


def _seconds(drive: Drive, start: int, end: int) -> float:
    """Between two frames; scans, where no times are known."""
    at = drive.times or drive.ticks
    return float(at[end] - at[start])


def _middle(turn: Turn) -> float:
    """Between the first and the last point's time; 0 where no times are known."""
    if turn.seconds is None:
        return 0.0
    return float(turn.seconds.min() + turn.seconds.max()) / 2


def _lasts(turn: Turn) -> float:
    """From the first point's time to the last one's; 0 where no times are known."""
    return 0.0 if turn.seconds is None else float(np.ptp(turn.seconds))


def _since(turn: Turn, seconds: float) -> Turn:
    """The same turn with its times counted from another moment of it."""
    return turn if turn.seconds is None else Turn(turn.points, turn.seconds - seconds)


def _longest_guess(drive: Drive, config: TrajectoryConfig) -> float:
    """How long a motion is believed to go on: seconds, or scans where no times are known."""
    steps = np.diff(drive.times or drive.ticks)
    return config.longest_guess * float(np.median(steps)) if len(steps) else 0.0


def usual_step_m(T_world_sensor: SE3, ticks: tuple[int | float, ...]) -> float:
    """How far the sensor goes from a scan to the next, the median."""
    if len(ticks) < 2:
        return 0.0
    return float(np.median(np.linalg.norm(_steps(T_world_sensor, ticks), axis=1)))


def jumps(
    T_world_sensor: SE3, ticks: tuple[int | float, ...], config: TrajectoryConfig
) -> Iterator[int]:
    """The frames that no vehicle reaches from the two before them."""
    changes = np.linalg.norm(np.diff(_steps(T_world_sensor, ticks), axis=0), axis=1)
    yield from (np.flatnonzero(changes > config.jump_m) + 2).tolist()


def _steps(T_world_sensor: SE3, ticks: tuple[int | float, ...]) -> Float[np.ndarray, "m 3"]:
    """From each frame to the next, metres a tick."""
    since = np.maximum(np.diff(ticks), HALF_TICK)
    return np.diff(T_world_sensor.translation.numpy(), axis=0) / since[:, None]
