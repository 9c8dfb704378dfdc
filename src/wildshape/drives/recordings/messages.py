# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of messages: those of ROS, and of a sensor's own packets."""

from pathlib import Path

from wildshape.drives.recording_checks import copies_told
from wildshape.drives.source import Drive
from wildshape.io.bags.reader import bag_files, open_bag
from wildshape.io.guard import reading
from wildshape.io.packets.reader import is_packet_file, open_packets


def find_bag(path: Path) -> bool:
    """Whether a path is such a recording.

    Raises:
        BadInputError: no file can have that name, or one is packed as a whole.
    """
    with reading(path, "a recording"):
        return bool(bag_files(path))


def open_recording(path: Path, topic: str | None = None) -> Drive:
    """The scans of a topic.

    Raises:
        BadInputError: no or several topics of point clouds, or no readable scan.
        MissingExtraError: rosbags or mcap is not installed.
    """
    bag = open_bag(path, topic)
    return Drive.of(
        name=path.resolve().stem if path.is_file() else path.resolve().name,
        path=path,
        scan_names=[f"{frame:06d}" for frame in range(len(bag.times))],
        read=bag,
        times=bag.times,
        warnings=[*bag.warnings, *copies_told(bag.copies), *bag.unread_times_told()],
        files=bag_files(path),
    )


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
    described = path.with_suffix(".json")
    return Drive.of(
        name=path.stem,
        path=path,
        scan_names=[f"{frame:06d}" for frame in range(len(times))],
        read=file,
        times=times,
        warnings=file.turns.warnings,
        files=(path, described) if described.is_file() else (path,),
    )
