# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes of PLY: the triangles between its points."""

from array import array
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import Float, Int64, Shaped

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise
from wildshape.io.scans.ply import (
    offsets,
    parse_rows,
    points_at,
    row_type,
    rows_of_elements,
    values_of,
)
from wildshape.io.scans.ply_header import Element, Header, Property, read_header

_CORNERS = ("vertex_indices", "vertex_index")
_FACE_LETTERS, _FACE_BYTES = len("3 0 1 2\n"), 4  # at least


def read_ply_mesh(path: Path) -> tuple[Float[np.ndarray, "n 3"], Int64[np.ndarray, "m 3"]]:
    """Vertices in the file's unit and the corners of each triangle, polygons as fans of them.

    Raises:
        BadInputError: as of `read_ply`; no faces, or binary faces that differ in their corners.
    """
    with path.open("rb") as file:
        header = read_header(file, path)
        _check_faces(header, path.stat().st_size - file.tell(), path)
        if header.order:
            return _read_binary(file.read(), header, path)
        return _read_ascii(file, header, path)


def _check_faces(header: Header, present: int, path: Path) -> None:
    faces = [element for element in header.elements if element.name == "face"]
    if len(faces) != 1 or not any(map(_lists_corners, faces[0].properties)):
        raise BadInputError(f"{path}: expected one PLY element 'face' with {_CORNERS[0]}.")
    least = faces[0].count * (_FACE_BYTES if header.order else _FACE_LETTERS)
    check_promise(path, "triangles", faces[0].count, least - (not header.order), present)


def _lists_corners(prop: Property) -> bool:
    return bool(prop.list_type) and prop.name in _CORNERS


def _corners_of(face: Element) -> int:
    """The place of the property that lists the vertices."""
    return next(i for i, prop in enumerate(face.properties) if _lists_corners(prop))


def _read_ascii(
    file: IO[bytes], header: Header, path: Path
) -> tuple[Float[np.ndarray, "n 3"], Int64[np.ndarray, "m 3"]]:
    points, faces = np.empty((0, 3)), np.empty((0, 3), np.int64)
    for element, rows in rows_of_elements(file, header, path):
        if element.name == "vertex":
            points = parse_rows(rows, element, path)
        elif element.name == "face":
            faces = _parse_faces(rows, element, path)
    return points, faces


def _read_binary(
    body: bytes, header: Header, path: Path
) -> tuple[Float[np.ndarray, "n 3"], Int64[np.ndarray, "m 3"]]:
    points, faces = np.empty((0, 3)), np.empty((0, 3), np.int64)
    for element, offset in offsets(body, header, path):
        if element.name == "vertex":
            points = points_at(body, offset, element, header.order, path)
        elif element.name == "face":
            faces = _faces_at(body, offset, element, header.order, path)
    return points, faces


def _parse_faces(rows: Iterator[bytes], element: Element, path: Path) -> Int64[np.ndarray, "m 3"]:
    corners, count = array("q"), 0
    place = _corners_of(element)
    for row in rows:
        corners.extend(fan([int(word) for word in values_of(row.split(), element)[place]]))
        count += 1
    if count < element.count:
        raise BadInputError(
            f"{path}: the header promises {element.count} faces, the file holds {count} lines of "
            "them: truncated; copy it again."
        )
    return np.frombuffer(corners, np.int64).reshape(-1, 3)


def fan(polygon: Sequence[int]) -> Iterator[int]:
    """The corners of its triangles, which all share the first one."""
    for side in pairwise(polygon[1:]):
        yield polygon[0]
        yield from side


def _faces_at(
    body: bytes, offset: int, element: Element, order: str, path: Path
) -> Int64[np.ndarray, "m 3"]:
    kind = row_type(body, offset, element, order)
    if kind is None:
        raise BadInputError(
            f"{path}: its faces are cut off, or differ in their corners; export triangles alone."
        )
    return _fans(np.frombuffer(body, kind, element.count, offset)[f"{_corners_of(element)}"])


def _fans(polygons: Shaped[np.ndarray, "k c"]) -> Int64[np.ndarray, "m 3"]:
    """The triangles of polygons of one size."""
    faces = np.empty((len(polygons), max(polygons.shape[1] - 2, 0), 3), np.int64)
    faces[..., 0] = polygons[:, :1]
    faces[..., 1] = polygons[:, 1:-1]
    faces[..., 2] = polygons[:, 2:]
    return faces.reshape(-1, 3)
