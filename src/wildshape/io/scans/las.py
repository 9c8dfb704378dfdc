# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""LAS and LAZ through laspy and lazrs, behind checks: both allocate what a file promises."""

import os
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise, check_unpacked

if TYPE_CHECKING:
    import laspy

_PIECE_BYTES = 16_000_000
_MOST_RECORDS = 10_000
_HEADER = struct.Struct("<HII")  # at byte 94: header size, offset to points, number of VLRs
_LAZ_POINTS_A_BYTE = 64  # far beyond what LAZ reaches on anything but equal points
_LAZ_PREFIX = struct.Struct("<HHBBHIIqqH")
_LAZ_ITEM = struct.Struct("<HHH")
_LAZ_LAYERED, _ANY_SIZE = 3, (1 << 32) - 1
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # layers of the items POINT14, RGB14, RGBNIR14, WAVEPACKET14
_BYTE14 = 14  # an item with a layer for each of its bytes
_STDERR = 2
_TRACE = re.compile(
    rb"^\n?thread '[^\n]*panicked at .*?(?:RUST_BACKTRACE[^\n]*\n|\Z)", re.DOTALL | re.MULTILINE
)
_alone = Lock()


def read_las(path: Path) -> Float[np.ndarray, "n 3"]:
    """Points with the file's scale and offset applied, float64, in the file's unit.

    Raises:
        BadInputError: no LAS or LAZ, or a header that promises more than the file holds.
    """
    _check_header(path)
    with without_traces():
        return _read(path, "xyz")


def read_las_field(path: Path, names: tuple[str, ...]) -> Float[np.ndarray, "n"] | None:
    """The first of these fields of the points of a file that `read_las` reads.

    None without, or if it holds zeros alone: newer kinds of points have room for all times.
    """
    with without_traces():
        with _opened(path) as reader:
            kinds = set(reader.header.point_format.dimension_names)
        found = [name for name in names if name in kinds]
        values = _read(path, found[:1]) if found else np.empty((0, 1))
    return values[:, 0] if values.any() else None


def _opened(path: Path) -> "laspy.LasReader":
    import laspy

    backend = laspy.LazBackend.Lazrs  # not the parallel one, which allocates whole chunks
    return laspy.open(path, laz_backend=backend, read_evlrs=False)  # pyright: ignore[reportCallIssue]


def _read(path: Path, names: Sequence[str]) -> Float[np.ndarray, "n k"]:
    with _opened(path) as reader:
        header = reader.header
        count, present = header.point_count, path.stat().st_size - header.offset_to_point_data
        packed = header.are_points_compressed
        least = count // _LAZ_POINTS_A_BYTE if packed else count * header.point_format.size
        check_promise(path, "points", count, least, max(present, 0))
        if packed:
            check_unpacked(path, count * header.point_format.size, max(present, 0))
            record = header.vlrs.get("LasZipVlr")[0].record_data  # pyright: ignore[reportAttributeAccessIssue]
            _check_compressed(
                path, header.offset_to_point_data, count, header.point_format.size, record
            )
        pieces = [np.empty((0, len(names)))]
        rows = max(1, _PIECE_BYTES // header.point_format.size)
        for piece in reader.chunk_iterator(min(rows, max(count, 1))):
            pieces.append(np.stack([np.asarray(piece[name]) for name in names], -1))
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
    present = path.stat().st_size
    if not size <= points <= present:
        raise BadInputError(
            f"{path}: the header puts its end at byte {size} and the points at {points}, but the"
            f" file has {present} bytes: truncated or damaged; copy it again."
        )
    check_promise(path, "variable length records", records, 54 * records, points - size)
    if records > _MOST_RECORDS:
        raise BadInputError(
            f"{path}: {records} variable length records are more than any program writes"
            f" ({_MOST_RECORDS}); write the file again."
        )


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
    # Each chunk begins with a point that is not compressed; an empty last one may be told of, too.
    check_promise(path, "LAZ chunks", chunks, (chunks - 1) * point_size, table - offset)
    kind, *_, chunk_size, _, _, number = _LAZ_PREFIX.unpack_from(record)
    items = [_LAZ_ITEM.unpack_from(record, _LAZ_PREFIX.size + 6 * i) for i in range(number)]
    size = sum(size for _, size, _ in items)
    if size != point_size:
        raise BadInputError(
            f"{path}: LAZ items of {size} bytes make no point of {point_size}: damaged; "
            "copy it again."
        )
    # lazrs goes by the items, whatever kind of compression is named beside them.
    if kind == _LAZ_LAYERED or any(item in (*_LAYERS, _BYTE14) for item, *_ in items):
        found = _count_layered(body[offset + 8 : table], items, count, chunk_size)
        if found != count:
            raise _truncated(path, count, found)


def _count_layered(
    body: bytes, items: list[tuple[int, int, int]], count: int, chunk_size: int
) -> int:
    """Points of a layered LAZ (point formats 6 and up), by walking its chunks.

    A chunk is its first point, a number of points, the sizes of its layers, and the layers. Layers
    that reach over the end count as no points, nor does a chunk of another size than is said: lazrs
    would look for the next one, and for its sizes, where none is.
    """
    layers = sum(size if item == _BYTE14 else _LAYERS.get(item, 0) for item, size, _ in items)
    first = sum(size for _, size, _ in items)
    at, found = 0, 0
    while found < count and at + first + 4 + 4 * layers <= len(body):
        points, *sizes = struct.unpack_from(f"<{1 + layers}I", body, at + first)
        at += first + 4 + 4 * layers + sum(sizes)
        size = points if chunk_size == _ANY_SIZE else min(chunk_size, count - found)
        found += points if at <= len(body) and points == size else 0
    return found


@contextmanager
def without_traces() -> Iterator[None]:
    """Leave out the traces of panics inside; all else that any thread writes to stderr follows.

    Rust writes to the file descriptor, so that is what is turned aside, by one thread at a time.
    """
    with _alone, TemporaryFile() as aside:
        try:
            kept = os.dup(_STDERR)
        except OSError:  # there is no stderr
            yield
            return
        os.dup2(aside.fileno(), _STDERR)
        try:
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)
            aside.seek(0)
            rest = _TRACE.sub(b"", aside.read())
            if rest:
                os.write(_STDERR, rest)
