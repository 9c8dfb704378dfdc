# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The header of a PLY file: what it says is compared with the file before any of it is made."""

from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

NAMES = {  # numpy's name: the PLY names
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
_TYPES = {name: kind for kind, names in NAMES.items() for name in names}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LINES = 10_000
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Property:
    """A column of an element."""

    name: str
    type: str
    list_type: str = ""  # the type of the list's length; empty: a plain number


@dataclass
class Element:
    """So many rows of the same properties."""

    name: str
    count: int
    properties: list[Property]

    @property
    def has_lists(self) -> bool:
        """Whether its rows may differ in length."""
        return any(p.list_type for p in self.properties)

    def row_bytes(self, order: str) -> int:
        """Bytes of a row at least (lists empty; ASCII: one digit and one separator a number)."""
        if not order:
            return 2 * len(self.properties)
        return sum(np.dtype(p.list_type or p.type).itemsize for p in self.properties)


@dataclass(frozen=True)
class Header:
    """What the file holds, in its order."""

    order: str  # "" is ASCII
    elements: list[Element]


def read_header(file: IO[bytes], path: Path) -> Header:
    """What a file says of itself; the file then stands where its numbers begin.

    Raises:
        BadInputError: no PLY, a header that lies about the file, or no x y z.
    """
    header = _parsed(file, path)
    _check(header, path.stat().st_size - file.tell(), path)
    return header


def _parsed(file: IO[bytes], path: Path) -> Header:
    if file.readline(16).strip() != b"ply":
        raise BadInputError(f"{path}: expected a PLY file (first line 'ply'), found another kind.")
    order, elements = None, []
    for _ in range(_LINES):
        line = file.readline(4096)
        words = line.decode("latin-1").split()
        if words[:1] == ["end_header"]:
            if order is None:
                raise BadInputError(f"{path}: the PLY header has no 'format' line; write it again.")
            return Header(order, elements)
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


def _parse_line(words: list[str], elements: list[Element], path: Path) -> None:
    match words:
        case ["element", name, count] if count.lstrip("-").isdecimal() and len(count) < 20:
            elements.append(Element(name, int(count), []))
        case ["property", "list", length, kind, name] if elements:
            elements[-1].properties.append(
                Property(name, _parse_type(kind, path), _parse_type(length, path, integer=True))
            )
        case ["property", kind, name] if elements:
            elements[-1].properties.append(Property(name, _parse_type(kind, path)))
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


def _check(header: Header, present: int, path: Path) -> None:
    vertices = [e for e in header.elements if e.name == "vertex"]
    names = [p.name for p in vertices[0].properties if not p.list_type] if vertices else []
    if len(vertices) != 1 or any(names.count(axis) != 1 for axis in AXES):
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
