# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store on disk: names of files and tensors, and mapping a safetensors file.

A store is a folder:

- `points-00000.safetensors`, ...: one tensor `points` `(n, 3)` float32 each. All clouds (the
  scans of a track, each with its rays after it, then its shape) lie one after the other; no track
  crosses a shard. Row numbers below count through all shards. Of a scan's `m` rays there are `m`
  rows of directions, then the ranges, three a row and 0 where nothing came back, then, where
  several sensors are merged, `m` rows of origins.
- `index.safetensors`: where everything lies, the poses and all texts (tensors of `INDEX`).
- `index.json`: format, version, checksums, provenance. Written last: no store without it.
  (`checks.py` says what is compared with which checksum.)
- `writing.json` while it is being written; then there may be finished `.parts/`, each with a store
  of its own, and `joining.json` while these become one.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.records import ShapeKind

FORMAT = "wildshape-store"
VERSION = 1
INDEX_JSON = "index.json"
INDEX_TENSORS = "index.safetensors"
WRITING_JSON = "writing.json"
JOINING_JSON = "joining.json"
PARTS = ".parts"
CURE = "copy or convert the store again"
SHARD_NAME = "points-{:05d}.safetensors"
POINT_BYTES = 12

INDEX: dict[str, str] = {
    "track_starts": "int64",  # (T + 1) first scan of each track
    "scan_starts": "int64",  # (S) first point of each scan
    "scan_sizes": "int64",  # (S) points of each scan
    "shard_starts": "int64",  # (K + 1) first point of each shard
    "shape_starts": "int64",  # (T) first point of each truth shape, -1: none
    "shape_sizes": "int64",  # (T)
    "pose_starts": "int64",  # (T) first row of a track in `poses`, -1: none
    "poses": "float64",  # (P, 3, 4) T_sensor_object, metres
    "text_bytes": "uint8",  # all different texts, UTF-8, or as the system names folders
    "text_starts": "int64",  # (texts + 1)
    "track_names": "int32",  # (T) numbers of texts, like the next four
    "categories": "int32",  # (T)
    "sources": "int32",  # (T)
    "sensors": "int32",  # (T) JSON as in track.json
    "scan_names": "int32",  # (S)
    "scan_crcs": "int64",  # (S) CRC-32 of each scan's bytes
    "shape_crcs": "int64",  # (T) of each truth shape's bytes, 0: none
}
"""Tensors of `index.safetensors` and their types; T tracks, S scans, K shards."""

EXTRAS: dict[str, str] = {
    "ray_scans": "int64",  # (R) the scans that have rays, rising
    "ray_counts": "int64",  # (R) rays of each
    "ray_starts": "int64",  # (R) first row of each
    "ray_rows": "int64",  # (R) rows of each
    "ray_crcs": "int64",  # (R) CRC-32 of each one's bytes
    "label_tracks": "int64",  # (L) the tracks with a labelled box, rising
    "label_sizes": "float64",  # (3 L) its length, width and height, metres
    "partial_shapes": "int64",  # the tracks whose shape is of their scans, rising
    "mirrored_shapes": "int64",  # the same, of their scans and these reflected
}
"""Tensors of the index that only stores have that need them."""

SHAPE_KINDS: dict[ShapeKind, str] = {"partial": "partial_shapes", "mirrored": "mirrored_shapes"}
"""Which of these list the tracks of a kind of shape; those in none have whole shapes."""

CRCS = ("scan_crcs", "shape_crcs")
"""Tensors that stores of older versions lack."""

DTYPES = {"float32": "F32", "float64": "F64", "int64": "I64", "int32": "I32", "uint8": "U8"}
"""numpy's names of types -> those of safetensors."""

_TYPES = {theirs: ours for ours, theirs in DTYPES.items()}
_LONGEST_HEADER = 1 << 20


def map_tensors(path: Path) -> dict[str, np.ndarray]:
    """The tensors of a safetensors file as views of the mapped file; nothing is read yet.

    The mapping is private (copy on write): the arrays are writable for torch, the file never
    changes. `safetensors` itself would copy what it hands to numpy.

    Raises:
        BadInputError: the file is damaged or holds less than its header says.
    """
    with reading(path, "a safetensors file"):
        size = path.stat().st_size
        with path.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            if not 0 < length <= min(_LONGEST_HEADER, size - 8):
                raise BadInputError(f"{path}: no safetensors header; the file is damaged.")
            header = json.loads(file.read(length))
        header.pop("__metadata__", None)
        data = np.memmap(path, np.uint8, mode="c").view(np.ndarray)[8 + length :]
        if max((entry["data_offsets"][1] for entry in header.values()), default=0) != len(data):
            raise BadInputError(
                f"{path}: its header does not fit its {len(data)} bytes; the file is damaged."
            )
        return {name: _view(data, entry, path) for name, entry in header.items()}


def _view(data: np.ndarray, entry: dict[str, Any], path: Path) -> np.ndarray:
    start, end = entry["data_offsets"]
    if not 0 <= start <= end <= len(data):
        raise BadInputError(f"{path}: truncated: {len(data)} of {end} bytes; convert again.")
    return data[start:end].view(_TYPES[entry["dtype"]]).reshape(entry["shape"])


@dataclass(frozen=True)
class FileRecord:
    """A file of the store as `index.json` lists it."""

    file: str
    bytes: int
    sha256: str
