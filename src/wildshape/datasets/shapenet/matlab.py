# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Arrays of numbers in MATLAB's files of versions 5 to 7, damaged ones included.

Not scipy's reader: a type that is none makes it read at address 0, which ends the program, and it
asks for as much memory as a damaged size says.
"""

import struct
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

_HEADER = 128  # bytes; the last four are the version and the order of bytes
_ORDERS = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}
_MATRIX, _COMPRESSED = 14, 15
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_CLASSES = range(6, 16)  # of numbers: double, single, int8 to uint64
_FREE_BYTES, _RATIO = 1 << 24, 4  # what may be unpacked: so much, and so many times the file


def read_matrices(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Those of the named arrays that the file holds; real parts, and no text, cells or structures.

    Raises:
        BadInputError: the file is missing, damaged, or of another version.
    """
    with reading(path, "a MATLAB file"):
        data = path.read_bytes()
        order = _ORDERS.get(data[_HEADER - 4 : _HEADER])
        if order is None:
            raise BadInputError(f"{path}: of another version than MATLAB's 5 to 7; save it as v7.")
        most = _FREE_BYTES + _RATIO * len(data)
        found: dict[str, np.ndarray] = {}
        for kind, element in _elements(memoryview(data)[_HEADER:], order):
            if kind == _COMPRESSED:
                kind, element = next(_elements(_unpacked(element, most), order))
            if kind == _MATRIX:
                found |= _matrix(element, order, names)
        return found


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Type and bytes of each element; what reaches over the end is an error."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind >> 16:  # up to four bytes, in the place of the size
            yield kind & 0xFFFF, data[at + 4 : at + 4 + min(kind >> 16, 4)]
            at += 8
            continue
        end = at + 8 + size
        if end > len(data):
            raise ValueError(f"an element of {size} bytes, of which {len(data) - at - 8} are there")
        yield kind, data[at + 8 : end]
        at = end if kind == _COMPRESSED else end + -size % 8


def _unpacked(element: memoryview, most: int) -> memoryview:
    packed = zlib.decompressobj()
    data = packed.decompress(element, most)
    if packed.unconsumed_tail:
        raise ValueError(f"an array of more than {most} bytes")
    return memoryview(data)


def _matrix(element: memoryview, order: str, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """The array under its name; nothing where it is none of these names or none of numbers."""
    parts = list(islice(_elements(element, order), 4))
    flags, shape, name, (kind, values) = (parts[0][1], parts[1][1], parts[2][1], parts[3])
    word = bytes(name).decode("latin-1")
    if word not in names or struct.unpack_from(f"{order}I", flags)[0] & 0xFF not in _CLASSES:
        return {}
    numbers = np.frombuffer(values, order + _TYPES[kind])
    return {word: numbers.reshape(np.frombuffer(shape, f"{order}i4"), order="F")}
