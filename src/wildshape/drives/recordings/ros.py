# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS."""

from pathlib import Path

from wildshape.drives.source import Drive
from wildshape.io.bags.reader import bag_files, open_bag


def find_bag(path: Path) -> bool:
    """Whether a path is such a recording."""
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
        scan_names=[f"{frame:06d}" for frame in range(len(bag.times))],
        read=bag,
        times=bag.times,
        warnings=bag.warnings,
    )
