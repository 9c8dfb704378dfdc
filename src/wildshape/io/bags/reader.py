# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scans of a recording of ROS: listed in one pass over its files, then read one by one."""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from wildshape.errors import BadInputError, MissingExtraError
from wildshape.io.bags.clouds import Cloud, cloud_of, frame_name, message_types, stamp
from wildshape.io.bags.storages import CLOUD, STORAGES, Key, Message, storage_of
from wildshape.io.guard import first_line, reading
from wildshape.io.progress import counted
from wildshape.io.scans.point_times import seconds_since, unusable_told
from wildshape.io.scans.points import check_near
from wildshape.records import Turn

_FEWEST_POINTS = 1000  # of a whole scan
_SOME = 3  # scans that tell what a clock says
_LONGEST_LAG_NS = 10e9  # of a recorder behind the stamps
_PACKED = (".db3.zstd", ".mcap.zstd")  # as `ros2 bag record --compression-mode file` does


class _Scan(NamedTuple):
    """Where a scan is."""

    stamped: int
    logged: int
    file: Path
    key: Key
    cdr: bool
    dropped: int
    frame: str
    mark: int  # equal for equal points; 0 of hardly any


@dataclass(frozen=True)
class Bag:
    """The scans of one topic of a recording, in time order.

    Attributes:
        times: of each scan, seconds, increasing: the messages' own stamps, or when they were
            recorded if they bear none.
        warnings: what is odd about it, a sentence each.
    """

    topic: str
    times: tuple[float, ...]
    warnings: tuple[str, ...]
    scans: tuple[_Scan, ...]

    def __call__(self, frame: int) -> Turn:
        """The points of a scan that have a return, and when each was taken.

        Raises:
            BadInputError: damaged, or without fields x, y and z.
        """
        scan = self.scans[frame]
        with reading(scan.file, f"a point cloud as scan {frame} of {self.topic}"):
            points, clock, _ = self._cloud(scan)
            check_near(points, f"{scan.file}, scan {frame}")
            kept = _returned(points)
            known = None if clock is None else seconds_since(clock[kept], self.times[frame])
            return Turn(points[kept].astype(np.float32), known)

    @property
    def copies(self) -> list[int]:
        """The scans that hold the points of the one before, to the last bit."""
        pairs = enumerate(pairwise(self.scans), 1)
        return [frame for frame, (before, after) in pairs if before.mark == after.mark != 0]

    def unread_times_told(self) -> tuple[str, ...]:
        """A sentence if some scans' points have times, and none tells when they were taken."""
        why = ""
        for frame in sorted({0, len(self.scans) // 2, len(self.scans) - 1}):
            with suppress(BadInputError), reading(self.scans[frame].file, "a point cloud"):
                points, clock, like = self._cloud(self.scans[frame])
                values = None if clock is None else clock[_returned(points)]
                if values is not None and seconds_since(values, self.times[frame]) is not None:
                    return ()
                if len(points) >= _FEWEST_POINTS:
                    why = why or unusable_told(values, like)
        return (f"{why}; scans are not corrected for the sensor's motion",) if why else ()

    @staticmethod
    def _cloud(scan: _Scan) -> Cloud:
        return cloud_of(storage_of(scan.file).data(scan.key), cdr=scan.cdr)


def bag_files(path: Path) -> list[Path]:
    """The files of a recording of ROS: the path itself, or the .db3 or .mcap of a folder.

    Empty if it is none.

    Raises:
        BadInputError: a file of it is packed as a whole.
    """
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if not file.name.startswith("."))
        suffixes = {".db3", ".mcap"}
    else:
        files, suffixes = [path] if path.is_file() else [], {*STORAGES}
    for file in files:
        if file.name.lower().endswith(_PACKED) and not file.with_suffix("").is_file():
            raise BadInputError(f"{file}: is packed as a whole; unpack it: unzstd {file.name}.")
    return [file for file in files if file.suffix.lower() in suffixes]


def open_bag(path: Path, topic: str | None = None) -> Bag:
    """List the scans of a recording; every file is read once, message by message.

    Args:
        path: a folder of ROS 2 with .db3 or .mcap, such a file, or a .bag of ROS 1.
        topic: of sensor_msgs/PointCloud2; only needed if there are several.

    Raises:
        BadInputError: no or several such topics, none of that name, or no readable scan.
        MissingExtraError: rosbags or mcap is not installed.
    """
    files = bag_files(path)
    if not files:
        raise BadInputError(f"{path}: holds no {', '.join(STORAGES)}; give a recording of ROS.")
    message_types(True)
    found: dict[str, list[_Scan]] = {}
    topics: dict[str, str] = {}
    damaged = []
    for file in files:
        storage = storage_of(file)
        try:
            for message in storage.clouds():
                found.setdefault(message.topic, []).append(_listed(message, file))
        except (MissingExtraError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever it is, the scans before it are good
            why = first_line(error) or type(error).__name__
            damaged.append(f"{file.name} is cut off or damaged ({why})")
        topics |= storage.topics
    chosen = _chosen(path, topic, topics, damaged)
    scans = found.get(chosen, [])
    if not scans:
        raise BadInputError(f"{path}: {'; '.join([*damaged, f'{chosen} holds no scan'])}.")
    told = tuple(f"{one}; {len(scans)} scans could be read" for one in damaged)
    scans, others = _of_one_sensor(chosen, scans)
    return _in_order(chosen, scans, (*told, *others))


def _listed(message: Message, file: Path) -> _Scan:
    """A scan's place, how many of its points are no measurement, and what tells of copies."""
    dropped = mark = 0
    with suppress(BadInputError), reading(file, "a point cloud"):  # reading the scan says why
        points = cloud_of(message.data, cdr=message.cdr).points
        kept = points[_returned(points)]
        dropped = len(points) - len(kept)
        mark = hash(kept.tobytes()) if len(kept) >= _FEWEST_POINTS else 0
    stamped = stamp(message.data, cdr=message.cdr)
    frame = frame_name(message.data, cdr=message.cdr)
    return _Scan(stamped, message.logged, file, message.key, message.cdr, dropped, frame, mark)


def _returned(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points were measured: drivers write NaN or the sensor's own place for no return."""
    sized = np.abs(points) <= np.finfo(np.float32).max
    return sized.all(1) & (points != 0).any(1)


def _chosen(path: Path, topic: str | None, topics: dict[str, str], damaged: list[str]) -> str:
    """The topic to read."""
    clouds = sorted(name for name, kind in topics.items() if kind == CLOUD)
    if topic in clouds:
        return str(topic)
    if not clouds:
        there = ", ".join(sorted({kind for kind in topics.values() if kind})) or "nothing"
        raise BadInputError(
            f"{path}: {'; '.join([*damaged, f'no topic of {CLOUD}, found {there}'])}; record the"
            " point clouds of the sensor's driver."
        )
    every = ", ".join(clouds)
    if topic is not None:
        raise BadInputError(f"{path}: no topic {topic} of point clouds; there are {every}.")
    if len(clouds) > 1:
        raise BadInputError(f"{path}: choose one of its topics with --topic: {every}.")
    return clouds[0]


def _of_one_sensor(topic: str, scans: list[_Scan]) -> tuple[list[_Scan], tuple[str, ...]]:
    """Of sensors that take turns in a topic the one with most scans, and a sentence on the others.

    A frame that only got another name on the way is still that of one sensor.
    """
    frames = [scan.frame for scan in sorted(scans, key=lambda scan: scan.logged)]
    counts = Counter(frames)
    if sum(one != other for one, other in pairwise(frames)) < max(2, len(counts)):
        return scans, ()
    most = max(counts, key=counts.__getitem__)
    others = " and ".join(name or "no name" for name in counts if name != most)
    told = (
        f"{topic} holds scans in {len(counts)} frames; those in {most or 'no name'} were taken,"
        f" which are most, and those in {others} left out"
    )
    return [scan for scan in scans if scan.frame == most], (told,)


def _in_order(topic: str, scans: list[_Scan], told: tuple[str, ...]) -> Bag:
    """A bag of scans sorted in time, one an instant."""
    stamped = all(scan.stamped for scan in scans)
    recorded = sorted(scans, key=lambda scan: scan.logged)  # file 10 comes before file 2
    if stamped and (by := _clock_set(recorded)):
        stamped = False
        told += (
            f"the stamps of {topic} {'rise' if by > 0 else 'fall'} by {abs(by) / 1e9:.2g} s between"
            " scans that were recorded one after the other: a clock was set; the times of"
            " recording are used",
        )
    taken = {scan.stamped if stamped else scan.logged: scan for scan in reversed(scans)}
    instants = sorted(taken)
    kept = tuple(taken[instant] for instant in instants)
    repeated, dropped = len(scans) - len(kept), sum(scan.dropped for scan in kept)
    if repeated:
        told += (f"{counted(repeated, 'scan')} with the time of another left out",)
    if dropped:
        told += (f"{counted(dropped, 'point')} without a return left out",)
    return Bag(topic, tuple(instant / 1e9 for instant in instants), told, kept)


def _clock_set(scans: list[_Scan]) -> float:
    """By how many nanoseconds stamps leap for good while scans were recorded in order; 0: nowhere.

    A scan that was recorded late falls back, too, but those after it do not. Stamps that rise by
    less than a recorder may lag behind are left to themselves.
    """
    stamps = np.array([scan.stamped for scan in scans], np.int64)
    logged = np.array([scan.logged for scan in scans], np.int64)
    if len(scans) < 2 * _SOME or not (np.diff(logged) > 0).all():
        return 0.0
    apart = (stamps - logged).astype(np.float64)
    leaps = np.flatnonzero((np.diff(stamps) < 0) | (np.diff(apart) > _LONGEST_LAG_NS)) + 1
    leaps = leaps[(leaps >= _SOME) & (leaps <= len(scans) - _SOME)]
    by = [float(np.median(apart[at:]) - np.median(apart[:at])) for at in leaps]
    step = float(np.median(np.diff(logged)))
    return max((one for one in by if not -step <= one <= _LONGEST_LAG_NS), key=abs, default=0.0)
