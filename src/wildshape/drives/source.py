# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive: its scans in time order, read one by one, and what is known of them."""

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, Num

from wildshape.drives.frame_cache import FrameCache
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import Twist
from wildshape.io.order import numbers_of
from wildshape.io.progress import counted
from wildshape.records import Points, Turn, as_text

HALF_TICK = 0.5  # scans less apart are of one moment; a reach of whole ticks ends half a tick on
_LONGEST_PAUSE = 1e9  # scans; more are no count
_MOMENT_S, _LONGEST_TURN_S = 0.01, 2.0
# Places that tell recordings apart: of all files about, of each at least and at most; bytes.
_PLACES, _FEWEST_PLACES, _MOST_PLACES, _SAMPLE_BYTES = 1024, 2, 64, 4096
_LONGEST_TURN = 1.5  # from a scan to the next; overlapping ones last a little longer
_CLOCK_BEGAN_S = 1.0  # ago; twice the longest turn that has times
_DATED = re.compile(r".*[0-9]{6}[^0-9.][0-9.]+$")  # 20260131_235959: minutes have 60 seconds
_NOTHING = Turn(np.empty((0, 3), np.float32))


@dataclass(frozen=True)
class Drive:
    """A recording: full scans of one sensor in time order.

    Attributes:
        name: of the recording.
        scan_names: one a frame; frames are counted from 0.
        ticks: when each was taken, counted in scans: a missing scan leaves its number out.
        moments: the same in parts of scans, where stamps are known: steps may be uneven.
        read: gives a frame's finite points, sensor frame, metres, and when each was taken, if
            that is known; they are not to be changed. `BadInputError` if it cannot.
        times: when each scan was taken, seconds, if known.
        T_world_sensor: `(n,)` poses, if known.
        warnings: what is odd about it, a sentence each.
        cut_by: how its objects are cut out, for their files.
        motion: of the sensor at each frame, once known: scans are corrected by it.
        contents: of the files that scans are read from: their sizes, and a hash of some bytes.
        path: as it was given, if it lies anywhere.
    """

    name: str
    scan_names: tuple[str, ...]
    ticks: tuple[int, ...]
    moments: tuple[float, ...]
    read: Callable[[int], Turn]
    times: tuple[float, ...] | None = None
    T_world_sensor: SE3 | None = None
    warnings: tuple[str, ...] = ()
    cut_by: str = "without labels"
    motion: tuple[Twist, ...] | None = None
    contents: tuple[int | str, ...] = ()
    path: Path | None = None

    @classmethod
    def of(
        cls,
        name: str,
        scan_names: Sequence[str],
        read: Callable[[int], Turn],
        times: Sequence[float] | None = None,
        T_world_sensor: SE3 | None = None,
        warnings: Sequence[str] = (),
        files: Iterable[Path] = (),
        path: Path | None = None,
    ) -> "Drive":
        """A drive whose ticks come from the scans' times, or from their names if these count.

        `files`: one a scan; where scans have none of their own, those of the recording.

        Raises:
            BadInputError: times, or names that count, do not rise.
        """
        names = tuple(map(as_text, scan_names))
        for row, (before, after) in enumerate(pairwise(times or ()), 2):
            if not after > before:
                wrong = (
                    "is the same as the one before it; give each scan its own"
                    if after == before
                    else "is not after the one before it; sort the scans in the order in which"
                    " they were taken"
                )
                raise BadInputError(f"{path or name}: time {row} ({after:.10g}) {wrong}.")
        ticks, moments, missing = _ticks(names, times, str(path or name))
        return cls(
            name=name,
            scan_names=names,
            ticks=ticks,
            moments=moments,
            read=FrameCache(read),
            times=None if times is None else tuple(times),
            T_world_sensor=T_world_sensor,
            warnings=(*warnings, *missing),
            contents=_contents(tuple(files)),
            path=path,
        )

    def __len__(self) -> int:
        return len(self.scan_names)

    @property
    def told(self) -> str:
        """What errors call it: its path, so that it is found."""
        return str(self.path or self.name)

    @cached_property
    def scan_s(self) -> float | None:
        """From a scan to the next, the median, seconds, if times are known."""
        if self.times is None or len(self) < 2:
            return None
        return float(np.median(np.diff(self.times)))

    @property
    def fingerprint(self) -> str:
        """Of names, times, poses, contents: another one is another recording, or a mended one."""
        poses = None if self.T_world_sensor is None else self.T_world_sensor.matrix.tolist()
        known = json.dumps((self.scan_names, self.times, poses, self.contents))
        return hashlib.sha256(known.encode()).hexdigest()

    def turn(self, frame: int) -> Turn:
        """A frame as it was read; without points where its file is damaged or empty.

        Without times of points where the scans have none: how long a turn takes is not known. Nor
        where the times span much more than the step between scans: the field holds something else.
        """
        try:
            turn = self.read(frame)
        except BadInputError:
            return _NOTHING
        if self.times is None or self._is_too_long(turn):
            return Turn(turn.points, origins=turn.origins)
        return self._timed(turn, self.times, frame)

    def _is_too_long(self, turn: Turn) -> bool:
        """Whether its points' times are of more than what lies between two scans."""
        seconds = turn.met if turn.seconds is None else turn.seconds
        if seconds is None or not len(seconds) or self.scan_s is None:
            return False
        return bool(np.ptp(seconds) > _LONGEST_TURN * self.scan_s)

    def _timed(self, turn: Turn, times: tuple[float, ...], frame: int) -> Turn:
        """A turn that begins as long before or after its scan's time as the others do.

        On a clock that began just now, times of points look like times since their scan's own; the
        scan that is farthest from then tells which they are.
        """
        surest = max(0, len(self) - 1, key=lambda one: abs(times[one]))
        began = _begins(turn)
        if began is None or frame == surest or not 0 < abs(times[frame]) < _CLOCK_BEGAN_S:
            return turn
        usual = _begins(self.turn(surest))
        if turn.seconds is None or usual is None:
            return turn
        by = min(0.0, -times[frame], times[frame], key=lambda by: abs(began + by - usual))
        return replace(turn, seconds=turn.seconds + by) if by else turn

    def scan(self, frame: int) -> Points:
        """A frame's points where they would be seen from the sensor's place at the scan's time.

        Points are as they were measured where the motion or their times are not known.
        """
        return self.corrected(frame, self.turn(frame))

    def corrected(self, frame: int, turn: Turn) -> Points:
        """The same of a frame that was read."""
        return turn.points if self.motion is None else turn.carried(self.motion[frame])

    def full_scan(self, frame: int) -> FullScan:
        """The same points, and where the sensor was when it took each of them."""
        turn = self.turn(frame)
        points = self.corrected(frame, turn)
        if self.motion is None or turn.seconds is None or not len(points):
            return FullScan(points, turn.origins)
        points[~turn.points.any(1)] = 0.0  # what did not come back has no place
        return FullScan(points, _places(self.motion[frame], turn.seconds))

    def moved_by(self, T_world_sensor: SE3) -> "Drive":
        """The drive with its scans corrected for the sensor's motion during each turn."""
        if self.times is None or len(self) < 2:
            return self  # how long a scan takes is not known
        return replace(self, motion=tuple(_motion(T_world_sensor, self.times)))


def _begins(turn: Turn) -> float | None:
    """When its first point was taken, since the scan's time, if that is known."""
    return None if turn.seconds is None or not len(turn.seconds) else float(turn.seconds.min())


def _contents(files: tuple[Path, ...]) -> tuple[int | str, ...]:
    """The size of each file, and a hash of what stands in some places of each."""
    digest, sizes = hashlib.sha256(), [file.stat().st_size for file in files]
    places = min(max(_PLACES // max(len(files), 1), _FEWEST_PLACES), _MOST_PLACES)
    for file, size in zip(files, sizes):
        with file.open("rb") as opened:
            for place in range(places):
                opened.seek(size * place // places)
                digest.update(opened.read(_SAMPLE_BYTES))
    return (*sizes, digest.hexdigest())


def _places(motion: Twist, seconds: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
    """Where the sensor was at some times, in few steps: rays of one place are looked at together.

    At 30 m/s a step is 0.3 m.
    """
    moments = np.rint(np.clip(seconds, -_LONGEST_TURN_S, _LONGEST_TURN_S) / _MOMENT_S).astype(int)
    first = int(moments.min())
    times = np.arange(first, int(moments.max()) + 1) * _MOMENT_S
    return motion.carry(np.zeros((len(times), 3), np.float32), times)[moments - first]


def _motion(T_world_sensor: SE3, times: Sequence[float]) -> list[Twist]:
    """At each frame, from the frame before it to the one after it, not across a pause."""
    last = len(times) - 1
    around = [_beside(frame, times, last) for frame in range(last + 1)]
    return [
        Twist.between(T_world_sensor[start], T_world_sensor[end], times[end] - times[start])
        for start, end in around
    ]


def _beside(frame: int, times: Sequence[float], last: int) -> tuple[int, int]:
    """A frame's neighbours, or itself in place of one a pause away; both if both are."""
    start, end = max(frame - 1, 0), min(frame + 1, last)
    near = tuple(
        one if abs(times[one] - times[frame]) <= _LONGEST_TURN_S else frame for one in (start, end)
    )
    return (near[0], near[1]) if near[0] < near[1] else (start, end)


def _ticks(
    names: tuple[str, ...], times: Sequence[float] | None, where: str
) -> tuple[tuple[int, ...], tuple[float, ...], tuple[str, ...]]:
    """When each scan was taken, in scans since the first, and a sentence if some are missing.

    Counted whole, then in thousandths: those are all whole where steps are even.
    """
    if times is not None:
        steps = _in_scans(np.diff(times))
    elif numbers := _numbers(names):
        steps = _numbered(names, numbers, where)
    else:
        steps = np.ones(len(names) - 1)
    ticks = _since_first(np.clip(np.rint(steps), 1, _LONGEST_PAUSE).astype(int))
    moments = _since_first(np.clip(np.round(steps, 3), 0.001, _LONGEST_PAUSE))
    missing = int(ticks[-1]) + 1 - len(names)
    told = (f"{counted(missing, 'scan')} missing between the others",) if missing else ()
    return tuple(ticks.tolist()), tuple(moments.tolist()), told


def _numbers(names: tuple[str, ...]) -> Sequence[int | float]:
    """What names count, alone or behind what they share; none where a date is before the time."""
    if all(name.isascii() and name.isdigit() for name in names):
        return [int(name) for name in names]
    return [] if any(_DATED.match(name) for name in names) else numbers_of(names)


def _numbered(
    names: tuple[str, ...], numbers: Sequence[int | float], where: str
) -> Float[np.ndarray, "m"]:
    """Steps of names that count scans one by one, or by tens, or are stamps of a clock.

    Raises:
        BadInputError: they do not rise.
    """
    steps = np.array([after - before for before, after in pairwise(numbers)], np.float64)
    if (steps <= 0).any():
        raise BadInputError(
            f"{where}: of {names[0]} to {names[-1]} some share a number; rename them."
        )
    one_by_one = (steps == 1).any() and all(float(number).is_integer() for number in numbers)
    return steps if one_by_one else _in_scans(steps)


def _in_scans(steps: Float[np.ndarray, "m"]) -> Float[np.ndarray, "m"]:
    """Steps in units of the middle one."""
    return steps / np.median(steps) if len(steps) else steps


def _since_first(steps: Num[np.ndarray, "m"]) -> Num[np.ndarray, "n"]:
    return np.concatenate(([0], np.cumsum(steps)))
