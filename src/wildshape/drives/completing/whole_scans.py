# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles held against whole scans, each of which is read once."""

from collections.abc import Callable, Sequence

from wildshape.drives.completing.carving import Carving
from wildshape.drives.completing.placing import Completed
from wildshape.drives.completing.surroundings import Surroundings
from wildshape.drives.completing.turns import Turns
from wildshape.drives.config import DriveConfig
from wildshape.records import Points


def held_against(
    read: Callable[[int], Points],
    vehicles: Sequence[Completed],
    doubtful: Sequence[Completed],
    turns: Turns,
    config: DriveConfig,
) -> tuple[list[Completed], set[str]]:
    """The vehicles with their boxes carved, and names of crowded ones, which are left out.

    Args:
        read: the whole scan of a frame, sensor frame, metres.
        vehicles: completed.
        doubtful: those of them that are none where much is around them.
        turns: of the drive's sensor.
        config: see there.
    """
    around = Surroundings(doubtful, turns, config.surroundings)
    carving = Carving(vehicles, turns, config.carving)
    show_scans(read, turns, around, carving)
    crowd = around.crowded()
    return [one for one in carving.carved() if one.seen.name not in crowd], crowd


def show_scans(
    read: Callable[[int], Points], turns: Turns, *watchers: Surroundings | Carving
) -> None:
    """Show watchers the scans that they ask for.

    Args:
        read: the whole scan of a frame, sensor frame, metres.
        turns: of the drive's sensor.
        watchers: who is shown them.
    """
    for frame in sorted(frozenset().union(*(one.frames for one in watchers))):
        scan = turns.T_level_sensor[frame].apply_numpy(read(frame))
        for one in watchers:
            if frame in one.frames:
                one.see(frame, scan)
