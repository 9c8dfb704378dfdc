# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a drive comes from: its scans in time order, read one by one, and what is known of them."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.bags.reader import Bag, bag_files, open_bag
from wildshape.io.bags.storages import STORAGES
from wildshape.io.guard import reading
from wildshape.io.poses import read_poses
from wildshape.io.scans.points import is_scan_file, read_points
from wildshape.records import Points

_BESIDE = ("poses.txt", "times.txt", "timestamps.txt", "calib.txt")
_RAW, _ODOMETRY = Path("velodyne_points") / "data", Path("velodyne")


@dataclass(frozen=True)
class Drive:
    """A recording: full scans of one sensor in time order.

    Attributes:
        name: of the recording.
        scan_names: one a frame; frames are counted from 0.
        ticks: when each was taken, counted in scans: a missing scan leaves its number out.
        times: the same in seconds, if known.
        T_world_sensor: `(n,)` poses, if known.
        read: gives a frame's finite points, sensor frame, metres; `BadInputError` if it cannot.
        warnings: what is odd about it, a sentence each.
        cut_by: how its objects are cut out, for their files.
    """

    name: str
    scan_names: tuple[str, ...]
    ticks: tuple[int, ...]
    read: Callable[[int], Points]
    times: tuple[float, ...] | None = None
    T_world_sensor: SE3 | None = None
    warnings: tuple[str, ...] = ()
    cut_by: str = "without labels"

    def __len__(self) -> int:
        return len(self.scan_names)

    def scan(self, frame: int) -> Points:
        """A frame's points; none where its file is damaged or empty."""
        try:
            return self.read(frame)
        except BadInputError:
            return np.empty((0, 3), np.float32)


@dataclass(frozen=True)
class _Files:
    """Reads a frame's file."""

    files: tuple[Path, ...]

    def __call__(self, frame: int) -> Points:
        return read_points(self.files[frame])


def open_drive(path: Path | str, topic: str | None = None) -> Drive:
    """A folder of full scans, a drive of KITTI raw, a sequence of KITTI odometry, or a bag of ROS.

    Scans are sorted by name. `times.txt` (seconds, a line a scan) and `poses.txt`
    (`T_world_sensor`) beside the scans are used; an odometry sequence's own poses are those of a
    camera and are not.

    Args:
        path: of the drive.
        topic: of point clouds, for a bag that holds several.

    Raises:
        BadInputError: no scans; times or poses of another number or not in order; no such topic.
        MissingExtraError: a bag is read, and a library for it is not installed.
    """
    path = Path(path)
    if bag_files(path):
        return _recorded(path, open_bag(path, topic))
    if not path.is_dir():
        raise BadInputError(
            f"{path}: no such folder; a drive is a folder of full scans or a recording of ROS"
            f" ({', '.join(STORAGES)})."
        )
    if topic is not None:
        raise BadInputError(f"{path}: has no topics, it is no recording of ROS; drop --topic.")
    if (path / _RAW).is_dir():
        times = _timestamps(path / _RAW.parent / "timestamps.txt")
        return _drive(path, _files(path / _RAW), times, None)
    if (path / _ODOMETRY).is_dir():
        return _drive(path, _files(path / _ODOMETRY), _seconds(path / "times.txt"), None)
    poses = path / "poses.txt" if (path / "poses.txt").is_file() else None
    return _drive(path, _files(path), _seconds(path / "times.txt"), poses)


def _drive(path: Path, files: list[Path], times: list[float] | None, poses: Path | None) -> Drive:
    names = tuple(file.stem for file in files)
    if times is not None:
        _check_times(times, len(files), path)
    ticks, missing = _ticks(names, times)
    return Drive(
        name=path.name or path.resolve().name,
        scan_names=names,
        ticks=ticks,
        read=_Files(tuple(files)),
        times=None if times is None else tuple(times),
        T_world_sensor=None if poses is None else read_poses(poses, len(files)),
        warnings=missing,
    )


def _recorded(path: Path, bag: Bag) -> Drive:
    names = tuple(f"{frame:06d}" for frame in range(len(bag.times)))
    ticks, missing = _ticks(names, list(bag.times))
    return Drive(
        name=path.resolve().stem if path.is_file() else path.resolve().name,
        scan_names=names,
        ticks=ticks,
        read=bag,
        times=bag.times,
        warnings=(*bag.warnings, *missing),
    )


def _files(folder: Path) -> list[Path]:
    """The scan files of a folder, sorted by name."""
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name)
    files = [entry for entry in entries if is_scan_file(entry) and entry.name not in _BESIDE]
    if not files:
        raise BadInputError(f"{folder}: holds no scan (.bin .pcd .ply .npy .laz ...).")
    for one, other in pairwise(files):
        if one.stem == other.stem:
            raise BadInputError(f"{folder}: {one.name} and {other.name} are one frame; remove one.")
    return files


def _ticks(
    names: tuple[str, ...], times: list[float] | None
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """When each scan was taken, in scans since the first, and a sentence if some are missing."""
    count = len(names)
    if times is not None and count > 1:
        since = np.array(times) - times[0]
        ticks = np.rint(since / np.median(np.diff(since))).astype(int)
        ticks = np.maximum.accumulate(np.maximum(ticks - np.arange(count), 0)) + np.arange(count)
    elif all(name.isascii() and name.isdigit() for name in names):
        ticks = np.array([int(name) for name in names]) - int(names[0])
    else:
        ticks = np.arange(count)
    if (np.diff(ticks) < 1).any():
        raise BadInputError(f"{names[0]} to {names[-1]}: scans share a number; rename them.")
    missing = int(ticks[-1]) + 1 - count
    told = (f"{missing} scans are missing between the others",) if missing else ()
    return tuple(ticks.tolist()), told


def _check_times(times: list[float], count: int, path: Path) -> None:
    if len(times) != count:
        raise BadInputError(f"{path}: {len(times)} times for {count} scans; give a line a scan.")
    for row, (before, after) in enumerate(pairwise(times), 2):
        if not after > before:
            raise BadInputError(
                f"{path}: time {row} ({after:.10g}) is not after the one before it; sort the scans"
                " in the order in which they were taken."
            )


def _seconds(path: Path) -> list[float] | None:
    """The numbers of a text file, if it is there."""
    if not path.is_file():
        return None
    with reading(path, "a time a line, seconds"):
        times = [float(line) for line in path.read_text("utf-8").split()]
        if not np.isfinite(times).all():
            raise ValueError("a time that is not finite")
        return times


def _timestamps(path: Path) -> list[float] | None:
    """KITTI raw's dates and times, seconds since 1970; nanoseconds are kept to the microsecond."""
    if not path.is_file():
        return None
    with reading(path, "a date and time a line"):
        lines = [line.strip() for line in path.read_text("utf-8").splitlines() if line.strip()]
        return [datetime.fromisoformat(line[:26]).replace(tzinfo=UTC).timestamp() for line in lines]
