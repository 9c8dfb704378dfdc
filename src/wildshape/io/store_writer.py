# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing a packed store: points stream into shards, memory holds the index alone."""

import hashlib
import json
import os
from array import array
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from wildshape.errors import BadInputError
from wildshape.geometry.se3 import SE3
from wildshape.io.atomic import atomic_write, write_json
from wildshape.io.store_format import (
    FORMAT,
    INDEX,
    INDEX_JSON,
    INDEX_TENSORS,
    POINT_BYTES,
    SHARD_NAME,
    VERSION,
    WRITING_JSON,
    FileRecord,
)
from wildshape.io.tracks import sensor_to_json
from wildshape.records import Track

_SHARD_BYTES = 256 << 20
_HEADER_BYTES = 256
_CODES = {"int64": "q", "int32": "i", "float64": "d", "uint8": "B"}


class StoreWriter:
    """Appends tracks to a new packed store, which exists only once `close` has returned.

    As a context manager it closes at the end of the block, or leaves a half-written store, which
    nothing will open, after an error.
    """

    def __init__(
        self,
        path: Path | str,
        provenance: dict[str, Any],
        *,
        overwrite: bool = False,
        shard_bytes: int = _SHARD_BYTES,
    ) -> None:
        """Start a store.

        Args:
            path: the folder to make.
            provenance: JSON values kept with the store (`io.provenance.provenance`).
            overwrite: replace a store, finished or half-written, at this path.
            shard_bytes: a shard is closed once it holds this much.

        Raises:
            BadInputError: something is at `path` already.
        """
        self.path = Path(path)
        self._provenance = provenance
        self._shard_bytes = shard_bytes
        _make_room(self.path, overwrite=overwrite)
        self.path.mkdir(parents=True, exist_ok=True)
        write_json(
            self.path / WRITING_JSON,
            {"format": FORMAT, "version": VERSION, "provenance": provenance},
        )
        self._columns = {name: array(_CODES[kind]) for name, kind in INDEX.items()}
        for name in ("track_starts", "shard_starts", "text_starts"):
            self._columns[name].append(0)
        self._texts: dict[str, int] = {}
        self._names: set[str] = set()
        self._points = 0
        self._shards: list[FileRecord] = []
        self._shard: _Shard | None = None

    def __enter__(self) -> "StoreWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        elif self._shard is not None:
            self._shard.abandon()

    def __len__(self) -> int:
        return len(self._columns["track_names"])

    def add(self, track: Track) -> None:
        """Append a track.

        Raises:
            BadInputError: a name that was added before, no scans, or poses and names of another
                length than the scans.
            OSError: the disk is full.
        """
        self._check(track)
        columns = self._columns
        if self._shard is None:
            self._shard = _Shard(self.path / SHARD_NAME.format(len(self._shards)))
        for points, name in zip(track.scans, track.scan_names):
            columns["scan_names"].append(self._text(name))
            columns["scan_sizes"].append(len(points))
            columns["scan_starts"].append(self._write(points))
        columns["track_starts"].append(len(columns["scan_sizes"]))
        columns["track_names"].append(self._text(track.name))
        columns["categories"].append(self._text(track.category))
        columns["sources"].append(self._text(track.source))
        columns["sensors"].append(self._text(json.dumps(sensor_to_json(track.sensor))))
        self._add_truth(track.T_sensor_object, track.shape)
        if self._shard.points * POINT_BYTES >= self._shard_bytes:
            self._end_shard()

    def close(self) -> None:
        """Finish the store: last shard, index, and at last `index.json`.

        Raises:
            BadInputError: not a single track was added.
            OSError: the disk is full; the store stays half-written and is not opened.
        """
        if not len(self):
            raise BadInputError(f"{self.path}: no track to store; check the source.")
        if self._shard is not None:
            self._end_shard()
        index = self._write_index()
        files = [index, *self._shards]
        digest = hashlib.sha256("".join(f.sha256 for f in files).encode()).hexdigest()
        manifest = {
            "format": FORMAT,
            "version": VERSION,
            "fingerprint": digest[:16],
            "tracks": len(self),
            "scans": len(self._columns["scan_sizes"]),
            "points": self._points,
            "index": asdict(index),
            "shards": [asdict(shard) for shard in self._shards],
            "provenance": self._provenance,
        }
        write_json(self.path / INDEX_JSON, manifest)
        (self.path / WRITING_JSON).unlink(missing_ok=True)

    def _check(self, track: Track) -> None:
        poses = track.T_sensor_object
        lengths = {len(track.scans), len(track.scan_names), len(poses or track.scans)}
        if len(lengths) > 1 or not track.scans:
            raise BadInputError(
                f"track {track.name}: {len(track.scans)} scans, {len(track.scan_names)} names and "
                f"{'no' if poses is None else len(poses)} poses do not fit together."
            )
        if track.name in self._names:
            raise BadInputError(f"two tracks are named '{track.name}'; rename one of them.")
        self._names.add(track.name)

    def _add_truth(self, poses: SE3 | None, shape: Float32[np.ndarray, "n 3"] | None) -> None:
        columns = self._columns
        columns["pose_starts"].append(-1 if poses is None else len(columns["poses"]) // 12)
        if poses is not None:
            rows = poses.matrix[:, :3].detach().cpu().numpy().astype(np.float64)
            columns["poses"].frombytes(np.ascontiguousarray(rows).tobytes())
        columns["shape_sizes"].append(0 if shape is None else len(shape))
        columns["shape_starts"].append(-1 if shape is None else self._write(shape))

    def _write(self, points: Float32[np.ndarray, "n 3"]) -> int:
        """Append a cloud to the shard; returns its first row."""
        assert self._shard is not None
        self._shard.write(points)
        start = self._points
        self._points += len(points)
        return start

    def _text(self, text: str) -> int:
        """The number of a text; equal texts are kept once."""
        if text not in self._texts:
            self._texts[text] = len(self._texts)
            self._columns["text_bytes"].frombytes(text.encode())
            self._columns["text_starts"].append(len(self._columns["text_bytes"]))
        return self._texts[text]

    def _end_shard(self) -> None:
        assert self._shard is not None
        self._shards.append(self._shard.finish())
        self._columns["shard_starts"].append(self._points)
        self._shard = None

    def _write_index(self) -> FileRecord:
        from safetensors.numpy import save

        tensors = {n: np.frombuffer(self._columns[n], kind) for n, kind in INDEX.items()}
        tensors["poses"] = tensors["poses"].reshape(-1, 3, 4)
        path = self.path / INDEX_TENSORS
        with atomic_write(path) as file:
            file.write(save(tensors))
        return _record(path)


class _Shard:
    """One `points` tensor of a length that is known at the end only: the header keeps its room."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.points = 0
        self._temporary = path.with_name(path.name + ".part")
        self._file = self._temporary.open("wb")
        self._file.write(bytes(_HEADER_BYTES))

    def write(self, points: Float32[np.ndarray, "n 3"]) -> None:
        self._file.write(np.ascontiguousarray(points, "<f4").data)
        self.points += len(points)

    def finish(self) -> FileRecord:
        offsets = [0, self.points * POINT_BYTES]
        tensor = {"dtype": "F32", "shape": [self.points, 3], "data_offsets": offsets}
        header = json.dumps({"points": tensor}).encode().ljust(_HEADER_BYTES - 8)
        self._file.seek(0)
        self._file.write(len(header).to_bytes(8, "little") + header)
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        self._temporary.replace(self.path)
        return _record(self.path)

    def abandon(self) -> None:
        self._file.close()


def _record(path: Path) -> FileRecord:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return FileRecord(path.name, path.stat().st_size, digest)


def _make_room(path: Path, *, overwrite: bool) -> None:
    """Refuse an existing output, or remove the store that is there: its own files, no others."""
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        return
    ours = path.is_dir() and any((path / name).exists() for name in (INDEX_JSON, WRITING_JSON))
    if not ours:
        raise BadInputError(f"{path}: exists and is no packed store; choose another output.")
    if not overwrite:
        state = "a packed store" if (path / INDEX_JSON).exists() else "a half-written packed store"
        raise BadInputError(f"{path}: {state} is there already; pass --overwrite to replace it.")
    # The store ends to exist with its manifest, which therefore goes first.
    for pattern in (INDEX_JSON, "index.safetensors", "points-*.safetensors*", ".*.part"):
        for file in path.glob(pattern):
            file.unlink()
