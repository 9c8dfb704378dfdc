# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The line of a text scan that names its columns: which are x, y and z, and in which unit."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.records import Unit

_UNITS: dict[str, Unit] = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
}
_LONGEST_NAME = 60
_MARK = re.compile(r"\s*(?:(?://|#)+\s*)?(?:(?:columns?|fields?|format)\s*:\s*)?", re.IGNORECASE)
_PLACE = r"(?:points?|pos(?:ition)?s?|coord(?:inate)?s?|loc(?:ation)?|field)"
_COLUMN = re.compile(
    rf"(?:{_PLACE}[ _.:-]?)?(?P<axis>[xyz])(?:[ _.:-]?{_PLACE})?"
    r"(?:\s*[_ ]?[(\[{]\s*(?P<bracket>[^)\]}]*?)\s*[)\]}]|[ _](?P<suffix>[kcmduµ]?m"
    r"|[a-z]*met(?:er|re)s?|ft|feet|in|inch(?:es)?|deg))?|points?(?:_m_xyz)?[:_](?P<number>[012])",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Columns:
    """Where the coordinates are.

    Attributes:
        places: of x, y and z, counted from 0.
        count: of all columns; 0 if nobody says.
        unit: as the header says.
    """

    places: tuple[int, int, int] = (0, 1, 2)
    count: int = 0
    unit: Unit | None = None


def columns_of(line: str, path: Path, count: int = 0) -> Columns | None:
    """The columns that a header names; None where it does not name x, y and z.

    Args:
        line: with the marks of a comment, if it is one.
        path: for the error.
        count: of columns, without which it is no header; 0 is any.

    Raises:
        BadInputError: it names one of them twice, or in units that differ or are unknown.
    """
    cells = _cells(line)
    if count and len(cells) != count:
        return None
    found: dict[str, list[tuple[int, str]]] = {"x": [], "y": [], "z": []}
    for place, cell in enumerate(cells):
        match = _COLUMN.fullmatch(cell) if len(cell) < _LONGEST_NAME else None
        if match:
            axis = match["axis"] or "xyz"[int(match["number"])]
            found[axis.lower()].append((place, (match["bracket"] or match["suffix"] or "").lower()))
    if not all(found.values()):
        return None
    if any(len(places) > 1 for places in found.values()):
        raise BadInputError(
            f"{path}: the header '{line[:80]}' names a coordinate twice; rename all columns but"
            " one to something else than x, y or z."
        )
    units = {unit for ((_, unit),) in found.values()}
    x, y, z = (places[0][0] for places in found.values())
    return Columns((x, y, z), len(cells), _unit(units, path))


def split(line: str, separator: str | None) -> list[str]:
    """The cells of a line; None separates by white space."""
    if separator is None:
        return [word.strip("\"'") for word in line.split()]
    if '"' in line:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return line.split(separator)


def _cells(line: str) -> list[str]:
    """Of a header, without what marks it; trailing empty ones left away."""
    line = _MARK.sub("", line, count=1)
    separator = next((s for s in ";\t," if s in line), None)
    glued = re.sub(r"\s+(?=[(\[{])", "", line) if separator is None else line
    cells = [cell.strip().strip("\"'").strip() for cell in split(glued, separator)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _unit(units: set[str], path: Path) -> Unit | None:
    if units == {""}:
        return None
    unit = _UNITS.get(next(iter(units)))
    if len(units) > 1 or unit is None:
        raise BadInputError(
            f"{path}: the header gives x, y and z in {' and '.join(sorted(units))[:40]!r}, but"
            " only m, cm or mm, the same for all, can be read; write them so."
        )
    return unit
