# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PLY: the header is parsed and checked here, the numbers are numpy's.

Not trimesh's reader: that one refuses binary files with faces of mixed sizes, takes a python call
a line of text, and believes the header before it looks at the file.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from struct import Struct
from typing import IO, Any

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise, lines_of

_NAMES = {  # numpy's name: the PLY names
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "i2": ("short", "int16"),
    "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"),
    "u4": ("uint", "uint32"),
    "i8": ("int64",),
    "u8": ("uint64",),
    "f2": ("float16",),
    "f4": ("float", "float32"),
    "f8": ("double", "float64"),
}
_TYPES = {name: kind for kind, names in _NAMES.items() for name in names}
_CODES = dict(zip(_NAMES, "bBhHiIqQefd"))  # of the module struct
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_HEADER_LINES = 10_000
_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class _Property:
    name: str
    type: str
    list_type: str = ""  # the type of the list's length; empty: a plain number


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property]

    @property
    def has_lists(self) -> bool:
        return any(p.list_type for p in self.properties)

    def row_bytes(self, order: str) -> int:
        """Bytes of a row at least (lists empty; ASCII: one digit and one separator a number)."""
        if not order:
            return 2 * len(self.properties)
        return sum(np.dtype(p.list_type or p.type).itemsize for p in self.properties)


@dataclass(frozen=True)
class _Header:
    order: str  # "" is ASCII
    elements: list[_Element]


def read_ply(path: Path) -> Float[np.ndarray, "n 3"]:
    """The x y z of the element `vertex`, in the file's unit; all else in the file is ignored.

    Raises:
        BadInputError: no PLY, a header that lies about the file, or no x y z.
    """
    with path.open("rb") as file:
        header = _read_header(file, path)
        present = path.stat().st_size - file.tell()
        _check_header(header, present, path)
        if header.order:
            return _read_binary(file.read(), header, path)
        return _read_ascii(file, header, path)


def _read_header(file: IO[bytes], path: Path) -> _Header:
    if file.readline(16).strip() != b"ply":
        raise BadInputError(f"{path}: expected a PLY file (first line 'ply'), found another kind.")
    order, elements = None, []
    for _ in range(_HEADER_LINES):
        line = file.readline(4096)
        words = line.decode("latin-1").split()
        if words[:1] == ["end_header"]:
            if order is None:
                raise BadInputError(f"{path}: the PLY header has no 'format' line; write it again.")
            return _Header(order, elements)
        if not line:
            break
        if words[:1] == ["format"]:
            order = _parse_format(words, path)
        else:
            _parse_line(words, elements, path)
    raise BadInputError(
        f"{path}: the PLY header does not end ('end_header' is missing): truncated?"
    )


def _parse_format(words: list[str], path: Path) -> str:
    name = words[1] if len(words) > 1 else ""
    if name not in _ORDERS:
        raise BadInputError(
            f"{path}: PLY format '{name}' is unknown; use one of {', '.join(_ORDERS)}."
        )
    return _ORDERS[name]


def _parse_line(words: list[str], elements: list[_Element], path: Path) -> None:
    match words:
        case ["element", name, count] if count.lstrip("-").isdecimal() and len(count) < 20:
            elements.append(_Element(name, int(count), []))
        case ["property", "list", length, kind, name] if elements:
            elements[-1].properties.append(
                _Property(name, _parse_type(kind, path), _parse_type(length, path, integer=True))
            )
        case ["property", kind, name] if elements:
            elements[-1].properties.append(_Property(name, _parse_type(kind, path)))
        case [] | ["comment", *_] | ["obj_info", *_]:
            pass
        case _:
            line = " ".join(words)[:80]
            raise BadInputError(
                f"{path}: the PLY header line '{line}' makes no sense; write it again."
            )


def _parse_type(name: str, path: Path, *, integer: bool = False) -> str:
    if name not in _TYPES or (integer and _TYPES[name][0] == "f"):
        raise BadInputError(
            f"{path}: the PLY property type '{name[:40]}' is unknown; expected one of "
            f"{', '.join(_TYPES)}."
        )
    return _TYPES[name]


def _check_header(header: _Header, present: int, path: Path) -> None:
    vertices = [e for e in header.elements if e.name == "vertex"]
    names = [p.name for p in vertices[0].properties if not p.list_type] if vertices else []
    if len(vertices) != 1 or any(names.count(axis) != 1 for axis in _AXES):
        raise BadInputError(
            f"{path}: expected one PLY element 'vertex' with x, y and z, found {names or 'none'}."
        )
    least = 0
    for element in header.elements:
        least += max(element.count, 0) * element.row_bytes(header.order)
        # The last line of a text may go without its line feed.
        check_promise(
            path, f"'{element.name}' rows", element.count, least - (not header.order), present
        )


def _read_ascii(file: IO[bytes], header: _Header, path: Path) -> Float[np.ndarray, "n 3"]:
    lines = lines_of(file, path)
    for element in header.elements:
        rows = islice(lines, element.count)
        if element.name == "vertex":
            return _parse_rows(rows, element, path)
        deque(rows, maxlen=0)
    raise AssertionError


def _parse_rows(rows: Iterator[bytes], element: _Element, path: Path) -> Float[np.ndarray, "n 3"]:
    first = next(rows, None)
    points = np.empty((0, 3))
    if first is not None and element.has_lists:
        values = (v for row in chain([first], rows) for v in _parse_list_row(row.split(), element))
        points = np.fromiter(values, np.float64).reshape(-1, 3)
    elif first is not None:
        names = [p.name for p in element.properties]
        columns = [names.index(axis) for axis in _AXES]
        points = np.loadtxt(chain([first], rows), usecols=columns, ndmin=2, comments=None)
    if len(points) < element.count:
        raise BadInputError(
            f"{path}: the header promises {element.count} points, the file holds {len(points)} "
            "lines of them: truncated; copy it again."
        )
    return points


def _parse_list_row(words: list[bytes], element: _Element) -> list[float]:
    values, at = {}, 0
    for prop in element.properties:
        if not prop.list_type:
            values[prop.name] = words[at]
        at += 1 + (int(words[at]) if prop.list_type else 0)
    return [float(values[axis]) for axis in _AXES]


def _read_binary(body: bytes, header: _Header, path: Path) -> Float[np.ndarray, "n 3"]:
    offset = 0
    for element in header.elements:
        kind = _row_type(body, offset, element, header.order)
        if element.name == "vertex":
            if kind is None:
                points = np.empty((element.count, 3))
                _walk(body, offset, element, header.order, path, points)
                return points
            return _axes(np.frombuffer(body, kind, element.count, offset), element)
        if kind is None:
            offset = _walk(body, offset, element, header.order, path)
        else:
            offset += element.count * kind.itemsize
    raise AssertionError


def _row_type(body: bytes, offset: int, element: _Element, order: str) -> np.dtype | None:
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


def _axes(rows: np.ndarray, element: _Element) -> Float[np.ndarray, "n 3"]:
    names = [p.name for p in element.properties]
    columns = [rows[f"{names.index(axis)}"] for axis in _AXES]
    single = all(column.dtype.kind == "f" and column.dtype.itemsize <= 4 for column in columns)
    return np.stack(columns, -1).astype(np.float32 if single else np.float64, copy=False)


def _walk(
    body: bytes,
    offset: int,
    element: _Element,
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
            _check_end(offset, body, path)
    return offset


def _step(
    prop: _Property, order: str, wanted: bool
) -> tuple[Callable[[bytes, int], tuple[Any, ...]] | None, int, int, int]:
    """How to pass a property: what reads it, its bytes, those of a list's item, which axis."""
    size = np.dtype(prop.type).itemsize
    if prop.list_type:
        kind = np.dtype(prop.list_type)
        return Struct(order + _CODES[prop.list_type]).unpack_from, kind.itemsize, size, -1
    if wanted and prop.name in _AXES:
        read = Struct(order + _CODES[prop.type]).unpack_from
        return read, size, 0, _AXES.index(prop.name)
    return None, size, 0, -1


def _check_end(end: int, body: bytes, path: Path) -> None:
    if end > len(body):
        raise BadInputError(
            f"{path}: the PLY header promises {end} bytes or more, {len(body)} follow it: "
            "truncated; copy it again."
        )
