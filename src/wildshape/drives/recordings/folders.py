# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Folders of scans: one's own, and KITTI's layouts."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from wildshape.drives.recording_checks import copies_of, copies_told
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError
from wildshape.io.bags.reader import bag_files
from wildshape.io.bags.storages import STORAGES
from wildshape.io.guard import reading
from wildshape.io.order import check_counted
from wildshape.io.packets.reader import SUFFIXES
from wildshape.io.poses import read_poses
from wildshape.io.scans.point_times import LIKE_TIMES, TIME_FIELDS, unusable_told
from wildshape.io.scans.points import is_scan_file
from wildshape.io.scans.turns import FIELDS, read_turn
from wildshape.records import Turn

_BESIDE = ("poses.txt", "times.txt", "timestamps.txt", "calib.txt")
_RAW, _ODOMETRY = Path("velodyne_points") / "data", "velodyne"
_TEXT = (".txt", ".csv")
_RECORDINGS = (*STORAGES, *SUFFIXES)  # that are one file each
_FEWEST_POINTS = 1000  # of a whole scan
_LONGEST_STEP_S = 20.0  # more are milliseconds, or smaller units
_SHORTEST_STEP_S = 0.005  # less are minutes, hours or days: no sensor takes so many scans
_OBJECTS = "velodyne_objects_xyz0"  # a drive of KITTI raw cut down to its vehicles


@dataclass(frozen=True)
class _Files:
    """Reads a frame's file."""

    files: tuple[Path, ...]
    times: tuple[float, ...] | None

    def __call__(self, frame: int) -> Turn:
        return read_turn(self.files[frame], None if self.times is None else self.times[frame])


def holds_scans(path: Path) -> bool:
    """Whether scans lie in a folder itself; text may be anything."""
    return path.is_dir() and any(
        is_scan_file(entry) and entry.suffix.lower() not in _TEXT for entry in path.iterdir()
    )


def find_folders(root: Path) -> list[Path]:
    """Folders of scans below a folder that holds none itself."""
    if _holds_objects(root):
        return []
    return sorted(folder for folder in root.glob("*/") if holds_scans(folder))


def open_folder(path: Path) -> Drive:
    """A folder of full scans, sorted by name.

    `times.txt` (seconds, a line a scan) and `poses.txt` (`T_world_sensor`) beside them are used.

    Raises:
        BadInputError: no full scans; times or poses of another number or not in order.
    """
    if not path.is_dir():
        what = "a file of another kind" if path.is_file() else "no such folder"
        raise BadInputError(
            f"{path}: {what}; a drive is a folder of full scans, a data set's folder or a"
            " recording of ROS or of packets (docs/drive.md)."
        )
    if _holds_objects(path):
        raise BadInputError(
            f"{path}: holds objects that were cut out of their scans; drive needs the whole scans."
            f" For objects there is: wildshape complete {path} --track."
        )
    files = _files(path)
    poses = path / "poses.txt"
    return _drive(path, files, path / "times.txt", poses if poses.is_file() else None)


def find_kitti_raw(root: Path) -> list[Path]:
    """Drives of KITTI raw at, one or two levels below a folder."""
    for level in ("", "*/", "*/*/"):
        found = sorted(folder.parents[1] for folder in root.glob(f"{level}{_RAW.as_posix()}"))
        if found:
            return found
    return []


def open_kitti_raw(path: Path) -> Drive:
    """A drive of KITTI raw; see `open_folder`."""
    return _drive(path, _files(path / _RAW), path / _RAW.parent / "timestamps.txt")


def find_kitti_tracking(root: Path) -> list[Path]:
    """The folders of scans of KITTI tracking's sequences, in the folder of a half or above both."""
    for halves in ((root,), (root / "training", root / "testing")):
        folders = (folder for half in halves for folder in sorted((half / _ODOMETRY).glob("*/")))
        found = [folder for folder in folders if folder.name.isdigit()]
        if found:
            return found
    return []


def find_sequences(root: Path) -> list[Path]:
    """Sequences of KITTI odometry or SemanticKITTI: a folder itself, or those in it."""
    for level in ("", "*/", "sequences/*/", "dataset/sequences/*/"):
        found = sorted(folder.parent for folder in root.glob(f"{level}{_ODOMETRY}"))
        if found:
            return found
    return []


def open_sequence(path: Path) -> Drive:
    """A sequence; its own poses are those of a camera and are not used. See `open_folder`."""
    return _drive(path, _files(path / _ODOMETRY), path / "times.txt")


def _drive(path: Path, files: list[Path], clock: Path, poses: Path | None = None) -> Drive:
    """A drive of some files; `clock`: their times, seconds or KITTI raw's, if it is there."""
    times = _timestamps(clock) if clock.name == "timestamps.txt" else _seconds(clock)
    if times is not None:
        times = _times_of(files, times)
        if len(times) != len(files):
            raise BadInputError(
                f"{clock}: {len(times)} times for {len(files)} scans; give a line a scan."
            )
        step = float(np.median(np.diff(times))) if len(times) > 1 else _LONGEST_STEP_S
        if step > _LONGEST_STEP_S or 0 < step < _SHORTEST_STEP_S:
            raise BadInputError(
                f"{clock}: {step:.6g} s from one scan to the next; write its times in seconds."
            )
    return Drive.of(
        name=path.name or path.resolve().name,
        path=path,
        scan_names=[file.stem for file in files],
        read=_Files(tuple(files), None if times is None else tuple(times)),
        times=times,
        T_world_sensor=None if poses is None else read_poses(poses, len(files)),
        warnings=copies_told(copies_of(files)) + _unread_times_told(files, times),
        files=files,
    )


def _unread_times_told(files: list[Path], times: list[float] | None) -> list[str]:
    """A sentence if some scans' points have times, and none of them tells when they were taken."""
    why = ""
    for at in sorted({0, len(files) // 2, len(files) - 1}):
        field = FIELDS.get(files[at].suffix.lower())
        if field is None:
            return []
        with suppress(BadInputError):  # it is damaged; the drive counts it
            turn = read_turn(files[at], None if times is None else times[at])
            if turn.seconds is not None:
                return []
            if len(turn.points) >= _FEWEST_POINTS:
                why = why or _unusable(partial(field, files[at]))
    return [f"{why}; scans are not corrected for the sensor's motion"] if why else []


def _unusable(field: Callable[[tuple[str, ...]], np.ndarray | None]) -> str:
    """Why a scan's points have no times, if they have a field of them.

    One value in a field of another name is no times, whatever it is called: zeros, or a stamp.
    """
    values, like = field(TIME_FIELDS), field(LIKE_TIMES)
    if values is not None or like is None or not np.ptp(like):
        return unusable_told(values)
    return unusable_told(None, next(name for name in LIKE_TIMES if field((name,)) is not None))


def _holds_objects(path: Path) -> bool:
    """Whether a folder holds objects cut out of scans, as the other commands take them."""
    tracks = [path / "scans", *path.glob("*/scans"), *path.glob("tracks/*/scans")]
    return (path / _OBJECTS).is_dir() or any(
        is_scan_file(entry) for track in tracks for entry in track.glob("*")
    )


def _files(folder: Path) -> list[Path]:
    """The scan files of a folder, sorted by name."""
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name)
    files = [entry for entry in entries if is_scan_file(entry) and entry.name not in _BESIDE]
    certain = [file for file in files if file.suffix.lower() not in _TEXT]  # text may be anything
    files = certain or files
    if not files:
        for entry in entries:
            if entry.suffix.lower() in _RECORDINGS or bag_files(entry):
                raise BadInputError(f"{folder}: holds recordings; name each, such as {entry}.")
        raise BadInputError(f"{folder}: holds no scan (.bin .pcd .ply .npy .laz ...).")
    for one, other in pairwise(files):
        if one.stem == other.stem:
            raise BadInputError(f"{folder}: {one.name} and {other.name} are one frame; remove one.")
    check_counted(files)
    return files


def _seconds(path: Path) -> list[float] | None:
    """The numbers of a text file, if it is there."""
    if not path.is_file():
        return None
    with reading(path, "a time a line, seconds"):
        times = [float(line) for line in path.read_text("utf-8-sig").split()]
        if not np.isfinite(times).all():
            raise ValueError("a time that is not finite")
        return times


def _timestamps(path: Path) -> list[float] | None:
    """KITTI raw's dates and times, seconds since 1970; nanoseconds are kept to the microsecond."""
    if not path.is_file():
        return None
    with reading(path, "a date and time a line"):
        lines = [line.strip() for line in path.read_text("utf-8-sig").splitlines() if line.strip()]
        return [datetime.fromisoformat(line[:26]).replace(tzinfo=UTC).timestamp() for line in lines]


def _times_of(files: list[Path], times: list[float]) -> list[float]:
    """Of a time for each number, those of the scans that are there."""
    names = [file.stem for file in files]
    if len(times) <= len(names) or not all(name.isascii() and name.isdigit() for name in names):
        return times
    numbers = [int(name) for name in names]
    return [times[number] for number in numbers] if max(numbers) < len(times) else times
