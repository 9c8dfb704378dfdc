# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The turns of a recording of packets, whoever made the sensor."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.packets.ouster import OusterTurns, open_ouster
from wildshape.io.packets.velodyne import VelodyneTurns, open_velodyne
from wildshape.records import Turn

SUFFIXES = (".pcap", ".pcapng")


@dataclass(frozen=True)
class PacketFile:
    """A recording of packets, its turns read one by one."""

    turns: VelodyneTurns | OusterTurns

    def __call__(self, number: int) -> Turn:
        """The finite points of a turn, sensor frame, metres, and when each was taken.

        Raises:
            BadInputError: damaged.
        """
        with reading(self.turns.path, f"packets of turn {number}"):
            turn = self.turns(number)
            kept = np.isfinite(turn.points).all(1)
            seconds = None if turn.seconds is None else turn.seconds[kept]
            return Turn(turn.points[kept], seconds)


def is_packet_file(path: Path) -> bool:
    """Whether a file is a recording of packets, by its suffix."""
    return path.suffix.lower() in SUFFIXES and path.is_file()


def open_packets(path: Path) -> PacketFile:
    """List the turns of a recording; it is read once.

    Velodyne's packets are known by themselves. Ouster's need what the sensor says of itself, a
    `.json` of the same name beside them.

    Raises:
        BadInputError: not a whole turn of either.
        MissingExtraError: velodyne-decoder or ouster-sdk is not installed.
    """
    described = path.with_suffix(".json")
    turns = open_ouster(path, described) if described.is_file() else open_velodyne(path)
    if not turns.times:
        odd = "".join(f"{one}; " for one in turns.warnings)
        raise BadInputError(
            f"{path}: {odd}no whole turn of a Velodyne; an Ouster's needs the sensor's own"
            f" description, {described.name}, beside it."
        )
    return PacketFile(turns)
