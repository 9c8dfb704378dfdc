# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store on disk: names of files and tensors, and mapping a safetensors file.

A store is a folder:

- `points-00000.safetensors`, ...: one tensor `points` `(n, 3)` float32 each. All clouds (the
  scans of a track, then its shape) lie one after the other; no track crosses a shard. Row numbers
  below count through all shards.
- `index.safetensors`: where everything lies, the poses and all texts (tensors of `INDEX`).
- `index.json`: format, version, checksums, provenance. Written last: no store without it.
- `writing.json` while it is being written; then there may be finished `.parts/`, each with a store
  of its own, and `joining.json` while these become one.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

FORMAT = "wildshape-store"
VERSION = 1
INDEX_JSON = "index.json"
INDEX_TENSORS = "index.safetensors"
WRITING_JSON = "writing.json"
JOINING_JSON = "joining.json"
PARTS = ".parts"
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
    "text_bytes": "uint8",  # all different texts, UTF-8
    "text_starts": "int64",  # (texts + 1)
    "track_names": "int32",  # (T) numbers of texts, like the next four
    "categories": "int32",  # (T)
    "sources": "int32",  # (T)
    "sensors": "int32",  # (T) JSON as in track.json
    "scan_names": "int32",  # (S)
}
"""Tensors of `index.safetensors` and their types; T tracks, S scans, K shards."""

DTYPES = {"float32": "F32", "float64": "F64", "int64": "I64", "int32": "I32", "uint8": "U8"}
"""numpy's names of types -> those of safetensors."""

_TYPES = {theirs: ours for ours, theirs in DTYPES.items()}
_KEYS = {"fingerprint", "tracks", "scans", "points", "index", "shards", "provenance"}
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


def manifest_of(
    index: FileRecord, shards: list[FileRecord], counts: dict[str, int], provenance: dict[str, Any]
) -> dict[str, Any]:
    """What `index.json` says.

    Args:
        index: the file of the index.
        shards: the files of points, in order.
        counts: of `tracks`, `scans` and `points`.
        provenance: JSON values.
    """
    digest = hashlib.sha256("".join(f.sha256 for f in (index, *shards)).encode()).hexdigest()
    return {
        "format": FORMAT,
        "version": VERSION,
        "fingerprint": digest[:16],
        **counts,
        "index": asdict(index),
        "shards": [asdict(shard) for shard in shards],
        "provenance": provenance,
    }


def read_manifest(path: Path) -> dict[str, Any]:
    """`index.json` of a finished store of this version.

    Raises:
        BadInputError: there is no store, it was never finished, or another version wrote it.
    """
    manifest = path / INDEX_JSON
    if not manifest.exists():
        if (path / WRITING_JSON).exists():
            raise BadInputError(
                f"{path}: a half-written packed store (its writer was stopped or still runs); "
                "repeat the command that was writing it, or write it again with --overwrite."
            )
        raise BadInputError(f"{path}: no packed store ({INDEX_JSON} is missing); check the path.")
    with reading(manifest, "the index of a packed store"):
        data = json.loads(manifest.read_text("utf-8"))
        found = (data.get("format"), data.get("version"))
        if found != (FORMAT, VERSION):
            raise BadInputError(
                f"{manifest}: expected {FORMAT} version {VERSION}, found {found[0]} version "
                f"{found[1]}; convert the data again with this version of Wildshape."
            )
        missing = _KEYS - data.keys()
        if missing:
            raise BadInputError(f"{manifest}: lacks {', '.join(sorted(missing))}; convert again.")
        return data
