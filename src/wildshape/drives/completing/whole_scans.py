# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles held against whole scans, each of which is read once."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from wildshape.drives.completing.free_space_length import Carving
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.completing.surroundings import Surroundings
from wildshape.drives.config import DriveConfig
from wildshape.records import Points


@runtime_checkable
class Watcher(Protocol):
    """Who learns from whole scans.

    Attributes:
        frames: whose scans it asks for.
    """

    frames: frozenset[int]

    def counted(self, frame: int, scan: Points) -> Any:
        """What a scan says, level world; any process may ask."""

    def add(self, counted: Any) -> None:
        """Keep it."""


InOrder = Callable[[Callable[[int], Any], Iterable[int]], Iterable[Any]]
"""`map`, or what does the same by several processes (`parallel/processes.py`)."""


def held_against(
    read: Callable[[int], Points],
    vehicles: Sequence[Completed],
    doubtful: Sequence[Completed],
    turns: Turns,
    config: DriveConfig,
    in_order: InOrder = map,
) -> tuple[list[Completed], set[str]]:
    """The vehicles with their boxes carved, and names of crowded ones, which are left out.

    Args:
        read: the whole scan of a frame, sensor frame, metres.
        vehicles: completed.
        doubtful: those of them that are none where much is around them.
        turns: of the drive's sensor.
        config: see there.
        in_order: looks at the scans.
    """
    around = Surroundings(doubtful, turns, config.surroundings)
    carving = Carving(vehicles, turns, config.carving)
    show_scans(read, turns, around, carving, in_order=in_order)
    crowd = around.crowded()
    return [one for one in carving.carved() if one.seen.name not in crowd], crowd


@dataclass(frozen=True)
class _Shown:
    """One scan after the other shown to watchers; it goes along to other processes."""

    read: Callable[[int], Points]
    turns: Turns
    watchers: tuple[Watcher, ...]

    def __call__(self, frame: int) -> list[Any]:
        """What it says to each; None to those that did not ask for it."""
        scan = self.turns.T_level_sensor[frame].apply_numpy(self.read(frame))
        return [one.counted(frame, scan) if frame in one.frames else None for one in self.watchers]


def show_scans(
    read: Callable[[int], Points], turns: Turns, *watchers: Watcher, in_order: InOrder = map
) -> None:
    """Show watchers the scans that they ask for; arguments as of `held_against`."""
    frames = sorted(frozenset[int]().union(*(one.frames for one in watchers)))
    for said in in_order(_Shown(read, turns, watchers), frames):
        for one, counted in zip(watchers, said):
            if counted is not None:
                one.add(counted)
