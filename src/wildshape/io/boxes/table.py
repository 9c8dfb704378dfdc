# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of a drive as a table: `boxes.csv`, a line a vehicle and frame (docs/drive.md)."""

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.io.atomic import write_text
from wildshape.io.boxes.detector import check_radians
from wildshape.io.guard import MAX_POINTS, reading


@dataclass(frozen=True)
class BoxRow:
    """One vehicle in one frame.

    Attributes:
        frame: counted from 0.
        time: seconds, if known.
        track: name of the vehicle.
        x: of the box's centre, the frame's sensor frame, metres, like y and z.
        length: metres, along the heading.
        width: metres.
        height: metres.
        yaw: heading about the sensor's z, radians, 0 along x.
        confidence: 0 to 1.
        points: of the frame's scan that belong to the vehicle.
        moving: or standing, as seen in the world.
    """

    frame: int
    time: float | None
    track: str
    x: float
    y: float
    z: float
    length: float
    width: float
    height: float
    yaw: float
    confidence: float
    points: int
    moving: bool


HEADER = tuple(field.name for field in fields(BoxRow))
_words = attrgetter(*HEADER)
_DECIMALS = 4


def write_box_table(path: Path, rows: Iterable[BoxRow]) -> None:
    """Write rows by frame, then track, to a tenth of a millimetre, times in full, atomically."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    for row in sorted(rows, key=lambda row: (row.frame, row.track)):
        frame, time, *others = _words(row)
        table.writerow([frame, "" if time is None else time, *map(_word, others)])
    write_text(path, text.getvalue())


def _word(value: object) -> object:
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, float):
        return round(value, _DECIMALS)
    return value


def read_box_table(path: Path | str) -> list[BoxRow]:
    """What `write_box_table` wrote.

    Raises:
        BadInputError: another header, or a line that is no box.
    """
    path = as_path(path, "path")
    with reading(path, "boxes of a drive"), path.open(encoding="utf-8-sig", newline="") as file:
        table = csv.reader(file)
        if tuple(next(table, ())) != HEADER:
            raise BadInputError(f"{path}: expected the header {','.join(HEADER)}.")
        return [_row(words) for words in table]


def _row(words: list[str]) -> BoxRow:
    frame, time, track, *numbers, points, moving = words
    x, y, z, length, width, height, yaw, confidence = map(float, numbers)
    found = BoxRow(
        frame=int(frame),
        time=float(time) if time else None,
        track=track,
        x=x,
        y=y,
        z=z,
        length=length,
        width=width,
        height=height,
        yaw=yaw,
        confidence=confidence,
        points=int(points),
        moving={"0": False, "1": True}[moving],
    )
    if not all(map(math.isfinite, (*map(float, numbers), found.time or 0.0))):
        raise ValueError("a number that is not finite")
    check_radians(found.yaw)
    if not 0 <= found.points <= MAX_POINTS:
        raise ValueError(f"{found.points} points")
    return found
