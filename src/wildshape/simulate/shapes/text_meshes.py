# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Triangles of OBJ, OFF and STL files, read line by line; materials and normals are left out."""

from array import array
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

import numpy as np

from wildshape.io.guard import lines_of
from wildshape.io.scans.ply_mesh import fan
from wildshape.simulate.shapes.triangles import Triangles

_STL_HEADER = 84
_STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
_MOST_WORDS = 1_000_000  # in a line that is continued


def read_obj(path: Path) -> Triangles:
    """All faces of an OBJ file, polygons as fans of triangles.

    Raises:
        Exception: of any kind; the file is damaged.
    """
    points, corners = array("d"), array("q")
    for words in _rows(path):
        match words:
            case [b"v", x, y, z, *_]:
                points.extend((float(x), float(y), float(z)))
            case [b"f", *polygon]:
                count = len(points) // 3
                corners.extend(fan([_corner(word, count) for word in polygon]))
    return _mesh(points, corners)


def _corner(word: bytes, count: int) -> int:
    """`vertex/texture/normal` counted from 1, or back from the last vertex."""
    number = int(word.partition(b"/")[0])
    return count + number if number < 0 else number - 1


def read_off(path: Path) -> Triangles:
    """All faces of an OFF file, polygons as fans of triangles.

    Raises:
        Exception: of any kind; the file is damaged.
    """
    rows = _rows(path)
    _, mark, beside = b" ".join(next(rows, [])).partition(b"OFF")
    if not mark:
        raise ValueError("no OFF in its first line")
    counts = beside.split() or next(rows)  # some write them behind OFF, even without a blank
    points, corners = array("d"), array("q")
    for x, y, z, *_ in _promised(rows, int(counts[0])):
        points.extend((float(x), float(y), float(z)))
    for size, *polygon in _promised(rows, int(counts[1])):
        if not 0 <= int(size) <= len(polygon):
            raise ValueError(f"a face of {int(size)} corners in a line of {len(polygon)}")
        corners.extend(fan([int(word) for word in polygon[: int(size)]]))
    return _mesh(points, corners)


def _promised(rows: Iterator[list[bytes]], count: int) -> Iterator[list[bytes]]:
    """So many rows."""
    found = 0
    for row in islice(rows, count):
        yield row
        found += 1
    if found < count:
        raise ValueError(f"{count} lines are promised, {found} are there")


def read_stl(path: Path) -> Triangles:
    """All faces of an STL file, binary or text.

    Raises:
        Exception: of any kind; the file is damaged.
    """
    with path.open("rb") as file:
        head = file.read(_STL_HEADER)
    count = int.from_bytes(head[80:], "little")
    if path.stat().st_size == _STL_HEADER + count * _STL_FACE.itemsize:
        faces = np.fromfile(path, _STL_FACE, offset=_STL_HEADER)
        points = faces["corners"].reshape(-1, 3).astype(np.float64)
    elif head.lstrip()[:5].lower() == b"solid":
        rows = (words[1:4] for words in _rows(path) if words[0].lower() == b"vertex")
        points = np.frombuffer(array("d", map(float, chain.from_iterable(rows)))).reshape(-1, 3)
    else:
        raise ValueError(f"{count} triangles in a file of another length")
    return points, np.arange(len(points)).reshape(-1, 3)


def _mesh(points: array, corners: array) -> Triangles:
    return np.frombuffer(points).reshape(-1, 3), np.frombuffer(corners, np.int64).reshape(-1, 3)


def _rows(path: Path) -> Iterator[list[bytes]]:
    """The words of each line; a backslash at its end continues it, `#` begins a comment."""
    words: list[bytes] = []
    with path.open("rb") as file:
        for line in lines_of(file, path):
            words += line.partition(b"#")[0].split()
            if words[-1:] == [b"\\"]:
                words.pop()
            elif words:
                yield words
                words = []
            if len(words) > _MOST_WORDS:
                raise ValueError(f"a line of more than {_MOST_WORDS} words")
    if words:
        yield words
