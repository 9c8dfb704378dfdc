# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points of PLY: the header is parsed and checked here, the numbers are numpy's.

Not trimesh's reader: that one refuses binary files with faces of mixed sizes, takes a python call
a line of text, and believes the header before it looks at the file.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from struct import Struct
from typing import IO, Any

import numpy as np
from jaxtyping import Float, Num

from wildshape.errors import BadInputError
from wildshape.io.guard import lines_of, reading
from wildshape.io.scans.ply_header import AXES, NAMES, Element, Header, Property, read_header

_CODES = dict(zip(NAMES, "bBhHiIqQefd"))  # of the module struct


def read_ply(path: Path) -> Float[np.ndarray, "n 3"]:
    """The x y z of the element `vertex`, in the file's unit; all else in the file is ignored.

    Raises:
        BadInputError: no PLY, a header that lies about the file, or no x y z.
    """
    with path.open("rb") as file:
        header = read_header(file, path)
        if header.order:
            return _read_binary(file.read(), header, path)
        return _read_ascii(file, header, path, AXES)


def read_ply_property(path: Path, names: tuple[str, ...]) -> Num[np.ndarray, "n"] | None:
    """The first of these properties of each point, as written; None where there is none of them.

    Raises:
        BadInputError: as `read_ply`.
    """
    with reading(path, "a PLY file"), path.open("rb") as file:
        header = read_header(file, path)
        vertex = next(one for one in header.elements if one.name == "vertex")
        plain = ["" if prop.list_type else prop.name for prop in vertex.properties]
        found = [name for name in names if name in plain]
        if not found:
            return None
        if not header.order:
            return _read_ascii(file, header, path, found[:1])[:, 0]
        body = file.read()
    offset = next(offset for one, offset in offsets(body, header, path) if one is vertex)
    kind = row_type(body, offset, vertex, header.order)
    if kind is None:
        return None
    return np.frombuffer(body, kind, vertex.count, offset)[f"{plain.index(found[0])}"]


def _read_ascii(
    file: IO[bytes], header: Header, path: Path, names: Sequence[str]
) -> Float[np.ndarray, "n k"]:
    for element, rows in rows_of_elements(file, header, path):
        if element.name == "vertex":
            return parse_rows(rows, element, path, names)
    raise AssertionError


def rows_of_elements(
    file: IO[bytes], header: Header, path: Path
) -> Iterator[tuple[Element, Iterator[bytes]]]:
    """The lines of each element."""
    lines = lines_of(file, path)
    for element in header.elements:
        rows = islice(lines, element.count)
        yield element, rows
        deque(rows, maxlen=0)


def parse_rows(
    rows: Iterator[bytes], element: Element, path: Path, names: Sequence[str] = AXES
) -> Float[np.ndarray, "n k"]:
    """Some properties, by default the points, in the lines of the element `vertex`."""
    first = next(rows, None)
    points = np.empty((0, len(names)))
    if first is not None and element.has_lists:
        parsed = (_parse_list_row(row.split(), element, names) for row in chain([first], rows))
        points = np.fromiter(chain.from_iterable(parsed), np.float64).reshape(-1, len(names))
    elif first is not None:
        listed = [p.name for p in element.properties]
        columns = [listed.index(name) for name in names]
        points = np.loadtxt(chain([first], rows), usecols=columns, ndmin=2, comments=None)
    if len(points) < element.count:
        raise BadInputError(
            f"{path}: the header promises {element.count} points, the file holds {len(points)} "
            "lines of them: truncated; copy it again."
        )
    return points


def _parse_list_row(words: list[bytes], element: Element, names: Sequence[str]) -> list[float]:
    values = values_of(words, element)
    places = {prop.name: place for place, prop in enumerate(element.properties)}
    return [float(values[places[name]][0]) for name in names]


def values_of(words: list[bytes], element: Element) -> list[list[bytes]]:
    """The words of each property."""
    values, at = [], 0
    for prop in element.properties:
        count = 1
        if prop.list_type:
            count = int(words[at])
            at += 1
        if not 0 <= count <= len(words) - at:
            raise ValueError(f"{count} numbers in a line that is too short")
        values.append(words[at : at + count])
        at += count
    return values


def _read_binary(body: bytes, header: Header, path: Path) -> Float[np.ndarray, "n 3"]:
    for element, offset in offsets(body, header, path):
        if element.name == "vertex":
            return points_at(body, offset, element, header.order, path)
    raise AssertionError


def offsets(body: bytes, header: Header, path: Path) -> Iterator[tuple[Element, int]]:
    """Where each element begins."""
    offset = 0
    for element in header.elements:
        yield element, offset
        kind = row_type(body, offset, element, header.order)
        if kind is None:
            offset = _walk(body, offset, element, header.order, path)
        else:
            offset += element.count * kind.itemsize


def points_at(
    body: bytes, offset: int, element: Element, order: str, path: Path
) -> Float[np.ndarray, "n 3"]:
    """The points in the bytes of the element `vertex`."""
    kind = row_type(body, offset, element, order)
    if kind is None:
        points = np.empty((element.count, 3))
        _walk(body, offset, element, order, path, points)
        return points
    return _axes(np.frombuffer(body, kind, element.count, offset), element)


def row_type(body: bytes, offset: int, element: Element, order: str) -> np.dtype | None:
    """The type of an element's rows, if they are all of one length and there."""
    fields: list[tuple[str, object]] = []
    for i, prop in enumerate(element.properties):
        if prop.list_type:
            kind = np.dtype([*fields, (f"n{i}", order + prop.list_type)])
            if offset + kind.itemsize > len(body):
                return None
            length = int(np.frombuffer(body, kind, 1, offset)[f"n{i}"][0])
            if not 0 <= length * np.dtype(prop.type).itemsize <= len(body) - offset:
                return None
            fields += [(f"n{i}", order + prop.list_type), (f"{i}", order + prop.type, (length,))]
        else:
            fields.append((f"{i}", order + prop.type))
    kind = np.dtype(fields)
    if offset + element.count * kind.itemsize > len(body):
        return None
    lengths = [f"n{i}" for i, prop in enumerate(element.properties) if prop.list_type]
    if lengths:
        rows = np.frombuffer(body, kind, element.count, offset)[lengths]
        if (rows != rows[:1]).any():
            return None
    return kind


def _axes(rows: np.ndarray, element: Element) -> Float[np.ndarray, "n 3"]:
    names = [p.name for p in element.properties]
    columns = [rows[f"{names.index(axis)}"] for axis in AXES]
    single = all(column.dtype.kind == "f" and column.dtype.itemsize <= 4 for column in columns)
    return np.stack(columns, -1).astype(np.float32 if single else np.float64, copy=False)


def _walk(
    body: bytes,
    offset: int,
    element: Element,
    order: str,
    path: Path,
    points: Float[np.ndarray, "n 3"] | None = None,
) -> int:
    """The end of an element whose rows differ in length; its x y z are written into `points`."""
    steps = [_step(prop, order, points is not None) for prop in element.properties]
    for row in range(element.count):
        for read, size, item, axis in steps:
            if read is not None and offset + size <= len(body):
                (value,) = read(body, offset)
                if axis >= 0 and points is not None:
                    points[row, axis] = value
                elif value < 0:
                    raise BadInputError(f"{path}: a PLY list of {value} items; write it again.")
                else:
                    offset += value * item
            offset += size
        if offset > len(body):
            raise BadInputError(
                f"{path}: the PLY header promises {offset} bytes or more, {len(body)} follow it: "
                "truncated; copy it again."
            )
    return offset


def _step(
    prop: Property, order: str, wanted: bool
) -> tuple[Callable[[bytes, int], tuple[Any, ...]] | None, int, int, int]:
    """How to pass a property: what reads it, its bytes, those of a list's item, which axis."""
    size = np.dtype(prop.type).itemsize
    if prop.list_type:
        kind = np.dtype(prop.list_type)
        return Struct(order + _CODES[prop.list_type]).unpack_from, kind.itemsize, size, -1
    if wanted and prop.name in AXES:
        read = Struct(order + _CODES[prop.type]).unpack_from
        return read, size, 0, AXES.index(prop.name)
    return None, size, 0, -1
