# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a sensor's own packets."""

from pathlib import Path

from wildshape.drives.source import Drive
from wildshape.io.packets.reader import is_packet_file, open_packets


def find_packets(path: Path) -> list[Path]:
    """The path itself, if it is such a recording."""
    return [path] if is_packet_file(path) else []


def open_packet_file(path: Path) -> Drive:
    """The turns of the sensor.

    Raises:
        BadInputError: no whole turn.
        MissingExtraError: the sensor's decoder is not installed.
    """
    file = open_packets(path)
    times = file.turns.times
    return Drive.of(
        name=path.stem,
        scan_names=[f"{frame:06d}" for frame in range(len(times))],
        read=file,
        times=times,
        warnings=file.turns.warnings,
    )
