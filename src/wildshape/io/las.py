# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""LAS and LAZ through laspy and lazrs, behind checks: both allocate what a file promises."""

import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

_PIECE = 1_000_000
_HEADER = struct.Struct("<HII")  # at byte 94: header size, offset to points, number of VLRs
_LAZ_POINTS_A_BYTE = 64  # far beyond what LAZ reaches on anything but equal points
_LAZ_PREFIX = struct.Struct("<HHBBHIIqqH")
_LAZ_ITEM = struct.Struct("<HHH")
_LAZ_LAYERED = 3
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # layers of the items POINT14, RGB14, RGBNIR14, WAVEPACKET14
_BYTE14 = 14  # an item with a layer for each of its bytes


def read_las(path: Path) -> Float[np.ndarray, "n 3"]:
    """Points with the file's scale and offset applied, float64, in the file's unit.

    Raises:
        BadInputError: no LAS or LAZ, or a header that promises more than the file holds.
    """
    import laspy

    _check_header(path)
    backend = laspy.LazBackend.Lazrs  # not the parallel one, which allocates whole chunks
    with laspy.open(path, laz_backend=backend, read_evlrs=False) as reader:  # pyright: ignore[reportCallIssue]
        header = reader.header
        count, present = header.point_count, path.stat().st_size - header.offset_to_point_data
        packed = header.are_points_compressed
        least = count // _LAZ_POINTS_A_BYTE if packed else count * header.point_format.size
        check_promise(path, "points", count, least, max(present, 0))
        if packed:
            record = header.vlrs.get("LasZipVlr")[0].record_data
            _check_compressed(
                path, header.offset_to_point_data, count, header.point_format.size, record
            )
        pieces = [np.empty((0, 3))]
        for piece in reader.chunk_iterator(min(_PIECE, max(count, 1))):
            pieces.append(np.stack([np.asarray(piece[axis]) for axis in "xyz"], -1))
    points = np.concatenate(pieces)
    if len(points) != count:
        raise _truncated(path, count, len(points))
    return points


def _truncated(path: Path, promised: int, found: int) -> BadInputError:
    return BadInputError(
        f"{path}: the header promises {promised} points, the file holds {found}: truncated or "
        "damaged; copy it again."
    )


def _check_header(path: Path) -> None:
    """Refuse what is no LAS, and variable length records that do not fit before the points."""
    with path.open("rb") as file:
        head = file.read(375)
    if head[:4] != b"LASF" or len(head) < 227:
        raise BadInputError(
            f"{path}: expected a LAS file (first bytes 'LASF'), found another kind."
        )
    size, points, records = _HEADER.unpack_from(head, 94)
    check_promise(path, "variable length records", records, 54 * records, max(points - size, 0))


def _check_compressed(path: Path, offset: int, count: int, point_size: int, record: bytes) -> None:
    """Refuse a LAZ whose sizes do not fit into the file; lazrs allocates them unseen."""
    body = path.read_bytes()
    table = struct.unpack_from("<q", body, offset)[0]
    if table == -1:  # written without going back: the place is told at the end
        table = struct.unpack_from("<q", body, len(body) - 8)[0]
    if not offset < table <= len(body) - 8:
        raise BadInputError(
            f"{path}: the table of LAZ chunks is missing: truncated; copy it again."
        )
    chunks = struct.unpack_from("<I", body, table + 4)[0]
    check_promise(path, "LAZ chunks", chunks, chunks, table - offset)
    kind, *_, number = _LAZ_PREFIX.unpack_from(record)
    items = [_LAZ_ITEM.unpack_from(record, _LAZ_PREFIX.size + 6 * i) for i in range(number)]
    size = sum(size for _, size, _ in items)
    if size != point_size:
        raise BadInputError(
            f"{path}: LAZ items of {size} bytes make no point of {point_size}: damaged; "
            "copy it again."
        )
    if kind == _LAZ_LAYERED:
        found = _count_layered(body[offset + 8 : table], items, count)
        if found != count:
            raise _truncated(path, count, found)


def _count_layered(body: bytes, items: list[tuple[int, int, int]], count: int) -> int:
    """Points of a layered LAZ (point formats 6 and up), by walking its chunks.

    A chunk is its first point, a number of points, the sizes of its layers, and the layers. Layers
    that reach over the end count as no points.
    """
    layers = sum(size if item == _BYTE14 else _LAYERS.get(item, 0) for item, size, _ in items)
    first = sum(size for _, size, _ in items)
    at, found = 0, 0
    while found < count and at + first + 4 + 4 * layers <= len(body):
        points, *sizes = struct.unpack_from(f"<{1 + layers}I", body, at + first)
        at += first + 4 + 4 * layers + sum(sizes)
        found += points if at <= len(body) else 0
    return found
