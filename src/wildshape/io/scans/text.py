# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points as text: .xyz, .txt, .csv; tabs, commas, semicolons or spaces, perhaps a header line."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import lines_of
from wildshape.io.scans.text_header import Columns, columns_of, split
from wildshape.records import Unit

_LONGEST = 65_536  # characters of a line
_COMMENTS = 10  # before the points, among which a header may be
_MISSING = ("", "na", "n/a", "null", "none", "-")
_SEPARATORS = (";", "\t", ",", None)
_DECIMAL_COMMA = (";", "\t")  # between these, a comma can only be a decimal one


@dataclass(frozen=True)
class _Layout:
    columns: Columns
    separator: str | None
    cells: int  # of the first row


def read_text(path: Path) -> Float[np.ndarray, "n 3"]:
    """The columns named x, y, z in a header line, or else the first three, in the file's unit.

    Lines that start with # or // are comments, the last of which may be the header. Cells count by
    their place: an empty x, y or z is NaN.

    Raises:
        BadInputError: no numbers where they are expected, a header that does not name x, y and z,
            cells that are missing where nothing but spaces separates them, or too many of them
            where commas do.
    """
    try:
        try:
            return _parsed(path, None)
        except ValueError as error:
            if isinstance(error, BadInputError | UnicodeDecodeError):
                raise
            return _parsed(path, _number)  # slower; knows empty cells
    except UnicodeDecodeError as error:
        raise BadInputError(
            f"{path}: expected text with x y z a line, found binary data."
        ) from error


def header_unit(path: Path) -> Unit | None:
    """The unit that a text's header gives to x, y and z, if any.

    Raises:
        BadInputError: as `read_text`.
    """
    with path.open(encoding="utf-8-sig") as file:
        layout, _ = _begin(_lines(file, path), path)
    return layout.columns.unit


def _parsed(path: Path, number: Callable[[str], float] | None) -> Float[np.ndarray, "n 3"]:
    with path.open(encoding="utf-8-sig") as file:
        lines = _lines(file, path)
        layout, first = _begin(lines, path)
        if not first:
            return np.empty((0, 3))
        rows = _rows(chain([first], lines), layout, path)
        return np.loadtxt(
            rows,
            delimiter=layout.separator,
            usecols=layout.columns.places,
            ndmin=2,
            comments=None,
            quotechar='"',
            converters=number,
        )


def _number(cell: str) -> float:
    text = cell.strip().strip("'")
    return float("nan") if text.lower() in _MISSING else float(text)


def _lines(file: TextIO, path: Path) -> Iterator[str]:
    return (line.rstrip("\r\n") for line in lines_of(file, path, _LONGEST))


def _begin(lines: Iterator[str], path: Path) -> tuple[_Layout, str]:
    """What the lines before the first point say, and that point's line; empty if there is none."""
    named, counted, comments = None, False, deque[str](maxlen=_COMMENTS)
    for line in lines:
        if _is_comment(line):
            comments.append(line)
        elif named is None and (found := _headless(line)):
            return _agreed(comments, found, path), line
        elif named is not None:
            return _headed(named, line, path), line
        elif line.strip().isdecimal() and not counted:  # the number of points
            counted = True
        else:
            named = columns_of(line, path)
            if named is None:
                raise BadInputError(
                    f"{path}: expected numbers, or a header that names x, y and z, found"
                    f" '{line[:80]}'; name the columns so."
                )
    return _Layout(named or Columns(), None, 0), ""


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "//"))


def _headless(line: str) -> _Layout | None:
    """The layout of a row whose first three cells are numbers."""
    for separator in _SEPARATORS:
        cells = _row_cells(line, separator)
        if len(cells) >= 3 and _are_numbers(cells[:3]):
            return _Layout(Columns(), separator, len(cells))
    return None


def _agreed(comments: Iterable[str], found: _Layout, path: Path) -> _Layout:
    """With the columns that the last comments name, if they are about rows of as many cells."""
    named = [columns_of(line, path, found.cells) for line in comments]
    fitting = [columns for columns in named if columns is not None]
    return replace(found, columns=fitting[-1]) if fitting else found


def _headed(named: Columns, line: str, path: Path) -> _Layout:
    for separator in _SEPARATORS:
        cells = _row_cells(line, separator)
        if len(cells) > max(named.places) and _are_numbers([cells[i] for i in named.places]):
            if len(cells) > named.count or (separator is None and len(cells) < named.count):
                break
            return _Layout(named, separator, len(cells))
    raise BadInputError(
        f"{path}: the header names {named.count} columns, but the first row, '{line[:80]}', has"
        " others; write a name for each column."
    )


def _row_cells(line: str, separator: str | None) -> list[str]:
    """Cells of a row, without the one after a separator at its end."""
    text = line.partition("#")[0].rstrip() if separator != "\t" else line.partition("#")[0]
    cells = split(text.replace(",", ".") if separator in _DECIMAL_COMMA else text, separator)
    return cells[:-1] if separator and cells and not cells[-1].strip() else cells


def _are_numbers(cells: list[str]) -> bool:
    try:
        values = [_number(cell) for cell in cells]
    except ValueError:
        return False
    return any(value == value for value in values) or any(cell.strip() for cell in cells)


def _rows(lines: Iterator[str], layout: _Layout, path: Path) -> Iterator[str]:
    """The rows as numpy reads them; comments left away."""
    separator, cells = layout.separator, layout.cells
    decimal_comma = separator in _DECIMAL_COMMA
    for line in lines:
        if "#" in line or "//" in line:
            if _is_comment(line):
                continue
            line = line.partition("#")[0]
        if separator is None and len(line.split()) < cells:
            raise BadInputError(
                f"{path}: a row has fewer values than the first, which spaces do not tell apart"
                f" ('{line[:80]}'); write commas between the columns."
            )
        if separator == "," and line.count(",") >= cells:
            _check_more(line, cells, path)
        yield line.replace(",", ".") if decimal_comma else line


def _check_more(line: str, cells: int, path: Path) -> None:
    """Refuse a row with more values than the first, as numbers with decimal commas are."""
    if any(cell.strip() for cell in _row_cells(line, ",")[cells:]):
        raise BadInputError(
            f"{path}: a row has more values than the first ('{line[:80]}'); write points, not"
            " commas, in numbers, and as many values a row."
        )
