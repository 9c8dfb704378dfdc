# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tells a damaged packed store from a whole one, checked where it is read.

A cloud has a CRC of its own, compared when it is first read: reading a few scans of a large shard
reads no more than these. The index is compared whole when it is opened, and so is each shard of a
store that an older version wrote without CRCs.
"""

import hashlib
import math
import time
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.store.layout import (
    CRCS,
    CURE,
    EXTRAS,
    INDEX,
    INDEX_JSON,
    INDEX_TENSORS,
    SHAPE_KINDS,
    FileRecord,
)
from wildshape.io.store.manifest import is_sealed
from wildshape.io.store.rays import rows_that_fit

_OF_SCANS = ("scan_starts", "scan_sizes", "scan_names", "scan_crcs")
_TEXTS_OF_TRACKS = ("track_names", "categories", "sources", "sensors")
_OF_TRACKS = (*_TEXTS_OF_TRACKS, "shape_starts", "shape_sizes", "shape_crcs", "pose_starts")
_SETTLED_S = 2.0  # a file changed more recently may change again without a new time of change


def cloud_crc(points: Float32[np.ndarray, "n 3"]) -> int:
    """The CRC-32 of a cloud's bytes; the points lie in one piece."""
    return zlib.crc32(points.data)


def is_finite(points: Float32[np.ndarray, "n 3"]) -> bool:
    """Whether all coordinates are numbers; the sum of squares says it at a third of the price."""
    return math.isfinite(np.vdot(points, points)) or bool(np.isfinite(points).all())


def check_file(path: Path, record: FileRecord) -> None:
    """Compare a whole file with its checksum.

    Raises:
        BadInputError: it is not what was written.
    """
    _refuse(complaint(path, record))


def check_file_once(path: Path, record: FileRecord) -> None:
    """As `check_file`, but not again in this process while the file stays as it is.

    Raises:
        BadInputError: it is not what was written.
    """
    status = path.stat()
    settled = time.time() - status.st_mtime > _SETTLED_S
    _refuse(
        _known_complaint(path.absolute(), record, status.st_mtime_ns, status.st_ino)
        if settled
        else complaint(path, record)
    )


@cache
def _known_complaint(path: Path, record: FileRecord, changed_ns: int, inode: int) -> str:  # noqa: ARG001
    return complaint(path, record)


def complaint(path: Path, record: FileRecord) -> str:
    """What is wrong with a file, or nothing."""
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found == record.sha256:
        return ""
    return (
        f"{path}: the checksum is wrong (expected {record.sha256[:12]}, found {found[:12]});"
        f" the file is damaged: {CURE}."
    )


def _refuse(said: str) -> None:
    if said:
        raise BadInputError(said)


def check_index(index: dict[str, np.ndarray], manifest: dict[str, Any], path: Path) -> None:
    """Whether the parts of an index fit each other, and `index.json`: nothing points outside.

    Raises:
        BadInputError: something does not fit.
    """
    needed = INDEX.keys() if any(name in index for name in CRCS) else INDEX.keys() - set(CRCS)
    kinds = {n: INDEX[n] for n in needed} | {n: EXTRAS[n] for n in EXTRAS if n in index}
    wrong = sorted(n for n in kinds if n not in index or index[n].dtype != kinds[n])
    if wrong:
        raise BadInputError(f"{path / INDEX_TENSORS}: lacks {', '.join(wrong)}; {CURE}.")
    with reading(path / INDEX_TENSORS, "the index of a packed store"):
        fits = all(_fits(index, len(manifest["shards"])))
    if not fits:
        raise BadInputError(f"{path / INDEX_TENSORS}: its parts do not fit; {CURE}.")
    found = {
        "tracks": len(index["track_names"]),
        "scans": len(index["scan_sizes"]),
        "points": int(index["shard_starts"][-1]),
    }
    unsealed = CRCS[0] in index and not is_sealed(manifest)
    if unsealed or any(manifest[key] != count for key, count in found.items()):
        raise BadInputError(f"{path / INDEX_JSON}: damaged, it does not fit its index; {CURE}.")


def _fits(index: dict[str, np.ndarray], shards: int) -> Iterator[bool]:
    """Each yields whether one thing holds; later ones need the earlier."""
    tracks, scans = len(index["track_names"]), len(index["scan_sizes"])
    texts, rows = len(index["text_starts"]) - 1, index["shard_starts"]
    points = int(rows[-1])
    yield all(index[n].shape == (tracks,) for n in _OF_TRACKS if n in index)
    yield all(index[n].shape == (scans,) for n in _OF_SCANS if n in index)
    yield index["poses"].shape[1:] == (3, 4) and rows.shape == (shards + 1,)
    yield _rises(index["track_starts"], tracks, scans)
    yield _rises(index["text_starts"], texts, len(index["text_bytes"]))
    yield _rises(rows, shards, points)
    for name in (*_TEXTS_OF_TRACKS, "scan_names"):
        yield _within(index[name], 0, texts - 1)
    yield _within(index["scan_sizes"], 0, points)
    yield _within(index["shape_sizes"], 0, points)
    yield _within(index["scan_starts"], 0, points - index["scan_sizes"])
    yield _within(index["shape_starts"], -1, points - index["shape_sizes"])
    posed = np.where(index["pose_starts"] < 0, 0, np.diff(index["track_starts"]))
    yield _within(index["pose_starts"], -1, len(index["poses"]) - posed)
    yield from _extras_fit({n: index[n] for n in EXTRAS if n in index}, tracks, scans, points)


def _extras_fit(
    extras: dict[str, np.ndarray], tracks: int, scans: int, points: int
) -> Iterator[bool]:
    """Whether what only some stores have fits the rest."""
    rays = [extras.get(name) for name in EXTRAS if name.startswith("ray_")]
    known = [column for column in rays if column is not None]
    yield len(known) in (0, len(rays)) and len({column.shape for column in known}) <= 1
    if known:
        yield _within(extras["ray_scans"], 0, scans - 1) and _climbs(extras["ray_scans"])
        yield bool(rows_that_fit(extras["ray_counts"], extras["ray_rows"]).all())
        yield _within(extras["ray_rows"], 0, points)
        yield _within(extras["ray_starts"], 0, points - extras["ray_rows"])
    labelled, sizes = (extras.get(name, np.zeros(0)) for name in ("label_tracks", "label_sizes"))
    yield sizes.shape == (3 * len(labelled),) and bool((sizes > 0).all())
    some = [labelled, *(extras.get(name, np.zeros(0)) for name in SHAPE_KINDS.values())]
    yield all(_within(known, 0, tracks - 1) and _climbs(known) for known in some)


def _climbs(numbers: np.ndarray) -> bool:
    return bool((np.diff(numbers) > 0).all())


def _rises(starts: np.ndarray, count: int, last: int) -> bool:
    """Whether `count + 1` starts go from 0 to `last`."""
    ends = starts.shape == (count + 1,) and starts[0] == 0 and starts[-1] == last
    return bool(ends and (starts[1:] >= starts[:-1]).all())


def _within(values: np.ndarray, least: int, most: int | np.ndarray) -> bool:
    return bool(((values >= least) & (values <= most)).all())
