# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PLY: the header is parsed and checked here, the numbers are numpy's.

Not trimesh's reader: that one refuses binary files with faces of mixed sizes, takes a python call
a line of text, and believes the header before it looks at the file.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

_NAMES = {  # numpy's name: the PLY names
    "i1": (
        "char",
        "int8",
    ),
    "u1": (
        "uchar",
        "uint8",
    ),
    "i2": (
        "short",
        "int16",
    ),
    "u2": (
        "ushort",
        "uint16",
    ),
    "i4": (
        "int",
        "int32",
    ),
    "u4": (
        "uint",
        "uint32",
    ),
    "i8": ("int64",),
    "u8": ("uint64",),
    "f2": ("float16",),
    "f4": (
        "float",
        "float32",
    ),
    "f8": (
        "double",
        "float64",
    ),
}
_TYPES = {name: kind for kind, names in _NAMES.items() for name in names}
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
        return _read_ascii(file.read(), header, path)


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


def _read_ascii(body: bytes, header: _Header, path: Path) -> Float[np.ndarray, "n 3"]:
    lines = [line for line in body.decode("latin-1").splitlines() if line and not line.isspace()]
    start = 0
    for element in header.elements:
        rows = lines[start : start + element.count]
        start += element.count
        if element.name == "vertex":
            return _parse_rows(rows, element, path)
    raise AssertionError


def _parse_rows(rows: list[str], element: _Element, path: Path) -> Float[np.ndarray, "n 3"]:
    if len(rows) < element.count:
        raise BadInputError(
            f"{path}: the header promises {element.count} points, the file holds {len(rows)} "
            "lines of them: truncated; copy it again."
        )
    if not rows:
        return np.empty((0, 3))
    if element.has_lists:
        return np.array([_parse_list_row(row.split(), element) for row in rows])
    names = [p.name for p in element.properties]
    columns = [names.index(axis) for axis in _AXES]
    return np.loadtxt(rows, usecols=columns, ndmin=2, comments=None)


def _parse_list_row(words: list[str], element: _Element) -> list[float]:
    values, at = {}, 0
    for prop in element.properties:
        if not prop.list_type:
            values[prop.name] = words[at]
        at += 1 + (int(words[at]) if prop.list_type else 0)
    return [float(values[axis]) for axis in _AXES]


def _read_binary(body: bytes, header: _Header, path: Path) -> Float[np.ndarray, "n 3"]:
    offset = 0
    for element in header.elements:
        if element.name == "vertex":
            break
        offset = _row_starts(body, offset, element, header.order, path)[-1]
    else:
        raise AssertionError
    if element.has_lists:
        return _read_list_rows(body, offset, element, header.order, path)
    fields = [(f"{i}", header.order + p.type) for i, p in enumerate(element.properties)]
    _check_end(offset + element.count * np.dtype(fields).itemsize, body, path)
    rows = np.frombuffer(body, np.dtype(fields), element.count, offset)
    names = [p.name for p in element.properties]
    return np.stack([rows[f"{names.index(axis)}"] for axis in _AXES], -1).astype(np.float64)


def _row_starts(body: bytes, offset: int, element: _Element, order: str, path: Path) -> list[int]:
    """Byte offset of each row of an element, and of its end; rows with lists are walked."""
    if not element.has_lists:
        size = element.row_bytes(order)
        return [offset, offset + element.count * size] if size else [offset]
    starts = [offset]
    for _ in range(element.count):
        for prop in element.properties:
            offset = _skip(body, offset, prop, order, path)
        starts.append(offset)
    return starts


def _skip(body: bytes, offset: int, prop: _Property, order: str, path: Path) -> int:
    item = np.dtype(prop.type).itemsize
    if prop.list_type:
        kind = np.dtype(order + prop.list_type)
        _check_end(offset + kind.itemsize, body, path)
        length = int(np.frombuffer(body, kind, 1, offset)[0])
        if length < 0:
            raise BadInputError(f"{path}: a PLY list of {length} items; write the file again.")
        offset += kind.itemsize
        item *= length
    _check_end(offset + item, body, path)
    return offset + item


def _read_list_rows(
    body: bytes, offset: int, element: _Element, order: str, path: Path
) -> Float[np.ndarray, "n 3"]:
    points = np.empty((element.count, 3))
    for row in range(element.count):
        for prop in element.properties:
            if prop.name in _AXES and not prop.list_type:
                kind = np.dtype(order + prop.type)
                _check_end(offset + kind.itemsize, body, path)
                points[row, _AXES.index(prop.name)] = np.frombuffer(body, kind, 1, offset)[0]
            offset = _skip(body, offset, prop, order, path)
    return points


def _check_end(end: int, body: bytes, path: Path) -> None:
    if end > len(body):
        raise BadInputError(
            f"{path}: the PLY header promises {end} bytes or more, {len(body)} follow it: "
            "truncated; copy it again."
        )
