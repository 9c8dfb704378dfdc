# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether what was found and what was labelled are of the same scans: frames are paired by place.

`frames.csv` says of each frame the name of its scan and how many points that had.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.scans.arrays import read_rows

FRAMES = "frames.csv"
_ROW_BYTES = 16  # x y z intensity, float32
_CURE = "give the labels of this very drive, with the scans it was made of"

Frames = dict[str, int]
"""Points of each scan by its name, in the order of the frames; 0 where a file was damaged."""


def read_frames(path: Path) -> Frames:
    """The scans of a drive's frames.

    Raises:
        BadInputError: the list is damaged.
    """
    with reading(path, "a list of frames"), path.open(encoding="utf-8", newline="") as file:
        rows = [
            (row["scan"], int(row["frame"]), int(row["points"])) for row in csv.DictReader(file)
        ]
        frames = {name: points for name, _, points in rows}
        if [frame for _, frame, _ in rows] != list(range(len(frames))):
            raise ValueError("frames that are not 0, 1, 2 and so on, a scan each")
        return frames


def check_same_scans(found: Path, scans: Sequence[Path]) -> None:
    """Refuse what was found in other scans than the labelled ones.

    Names are compared that are numbers, as those of labelled scans are, but for mere counts: scans
    of bags have no other names. A folder without a list of frames is believed.

    Args:
        found: a folder that `wildshape drive` wrote.
        scans: files of the labelled scans, of KITTI's format.

    Raises:
        BadInputError: they are others, or the list or a scan is damaged.
    """
    path = found / FRAMES
    if not path.is_file():
        return
    frames = read_frames(path)
    if len(frames) != len(scans):
        raise BadInputError(
            f"{path}: is of {len(frames)} scans, but the labels know {len(scans)}; {_CURE}."
        )
    numbers = [int(name) if name.isascii() and name.isdigit() else None for name in frames]
    named = numbers != list(range(len(numbers)))
    for (name, points), number, scan in zip(frames.items(), numbers, scans):
        if named and number is not None and number != int(scan.stem):
            raise BadInputError(f"{path}: has scan {name} where the labels have {scan}; {_CURE}.")
        if points and not _holds(scan, points):
            raise BadInputError(
                f"{path}: scan {name} has {points} points, which {scan} has not; {_CURE}."
            )


def _holds(scan: Path, points: int) -> bool:
    """Whether a scan has so many points, with or without what did not come back."""
    with reading(scan, "x y z intensity in float32"):
        if scan.stat().st_size == points * _ROW_BYTES:
            return True
    rows = read_rows(scan, "x y z intensity")
    came_back = np.isfinite(rows).all(1) & rows.any(1)
    return int(came_back.sum()) <= points <= len(rows)
