# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing a packed store: points stream into shards and the index into its columns."""

import json
import math
import os
import shutil
from contextlib import suppress
from itertools import repeat
from pathlib import Path
from typing import Any, get_args
from weakref import finalize

import numpy as np
from jaxtyping import Float32

from wildshape.arguments import as_path, expect, expect_whole
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import hold_folder, naming, write_json
from wildshape.io.sensor_json import sensor_to_json
from wildshape.io.store.checks import cloud_crc, is_finite
from wildshape.io.store.index import IndexWriter, file_record
from wildshape.io.store.layout import (
    FORMAT,
    INDEX_JSON,
    INDEX_TENSORS,
    JOINING_JSON,
    PARTS,
    POINT_BYTES,
    SHAPE_KINDS,
    SHARD_NAME,
    VERSION,
    WRITING_JSON,
    FileRecord,
)
from wildshape.io.store.manifest import manifest_of
from wildshape.io.store.rays import rows_of_rays
from wildshape.io.tracks import check_lengths, check_points
from wildshape.records import ShapeKind, SightLines, Track

_SHARD_BYTES = 256 << 20
_HEADER_BYTES = 256


class StoreWriter:
    """Appends tracks to a new packed store, which exists only once `close` has returned.

    As a context manager it closes at the end of the block, or leaves a half-written store, which
    nothing will open, after an error. Until then no other writer is let in.
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
            provenance: JSON values kept with the store (`io.output.provenance`).
            overwrite: replace a store, finished or half-written, at this path.
            shard_bytes: a shard is closed once it holds this much.

        Raises:
            BadInputError: something is at `path` already, or another writer is at work there.
        """
        self.path = as_path(path, "path")
        self._provenance = provenance
        self._shard_bytes = expect_whole(shard_bytes, "shard_bytes")
        if self.path.is_file():
            check_room(self.path, overwrite=overwrite)
        # Of a writer that is forgotten unclosed, too.
        self._let_go = finalize(self, hold_folder(self.path))
        try:
            self._begin(overwrite=overwrite)
        except BaseException:
            self._let_go()
            raise

    def _begin(self, *, overwrite: bool) -> None:
        check_room(self.path, overwrite=overwrite)
        # First: a removal that was stopped then leaves a half-written store, not a foreign folder.
        write_json(
            self.path / WRITING_JSON,
            {"format": FORMAT, "version": VERSION, "provenance": self._provenance},
        )
        remove_store(self.path)
        self._index = IndexWriter(self.path)
        self._names: set[str] = set()
        self._points = 0
        self._shards: list[FileRecord] = []
        self._shard: _Shard | None = None
        self._closed = False

    def __enter__(self) -> "StoreWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.close()
            else:
                self._abandon()
        finally:
            self._let_go()

    def __len__(self) -> int:
        return self._index.count("track_names")

    def add(self, track: Track) -> None:
        """Append a track.

        Raises:
            BadInputError: a name that was added before, no scans, poses and names of another
                length than the scans, a scan or shape without points, points that are not finite
                x, y, z, poses that are not rigid, a labelled box without a size, or a kind of
                shape that there is not.
            OSError: the disk is full.
            ValueError: the store is closed.
        """
        if self._closed:
            raise ValueError(f"{self.path}: the store is closed.")
        self._check(track)
        index = self._index
        if self._shard is None:
            self._shard = _Shard(self.path / SHARD_NAME.format(len(self._shards)))
        for points, name, rays in zip(track.scans, track.scan_names, track.rays or repeat(None)):
            if rays is not None:
                self._add_rays(rays)
            index.append("scan_names", index.text(name))
            index.append("scan_sizes", len(points))
            start, crc = self._write(points)
            index.append("scan_starts", start)
            index.append("scan_crcs", crc)
        index.append("track_starts", index.count("scan_sizes"))
        index.append("track_names", index.text(track.name))
        index.append("categories", index.text(track.category))
        index.append("sources", index.text(track.source))
        index.append("sensors", index.text(json.dumps(sensor_to_json(track.sensor))))
        self._add_truth(track.T_sensor_object, track.shape)
        if track.label_size_m is not None:
            index.append("label_tracks", len(self) - 1)
            index.extend("label_sizes", np.array(track.label_size_m))
        if track.shape_kind in SHAPE_KINDS:
            index.append(SHAPE_KINDS[track.shape_kind], len(self) - 1)
        if self._shard.points * POINT_BYTES >= self._shard_bytes:
            self._end_shard()

    def close(self) -> None:
        """Finish the store: last shard, index, and at last `index.json`; once is enough.

        Raises:
            BadInputError: not a single track was added.
            OSError: the disk is full; the store stays half-written and is not opened.
        """
        if self._closed:
            return
        if not len(self):
            raise BadInputError(f"{self.path}: no track to store; check the source.")
        if self._shard is not None:
            self._end_shard()
        counts = {
            "tracks": len(self),
            "scans": self._index.count("scan_sizes"),
            "points": self._points,
        }
        manifest = manifest_of(self._index.finish(), self._shards, counts, self._provenance)
        write_json(self.path / INDEX_JSON, manifest, flush=True)
        (self.path / WRITING_JSON).unlink(missing_ok=True)
        self._closed = True
        self._let_go()

    def _check(self, track: Track) -> None:
        """Refuse what no reader would take: one such track and the store never opens again."""
        check_lengths(expect(track, Track, "track"))
        if track.name in self._names:
            raise BadInputError(f"two tracks are named '{track.name}'; rename one of them.")
        check_points(track)
        clouds = track.scans if track.shape is None else (*track.scans, track.shape)
        empty = [cloud is track.shape for cloud in clouds if not len(cloud)]
        if empty:
            raise BadInputError(
                f"track {track.name}: has a {'shape' if empty[0] else 'scan'} without points; leave"
                " it out."
            )
        with np.errstate(over="ignore"):  # what float32 cannot hold is infinite
            finite = all(is_finite(np.asarray(cloud, np.float32)) for cloud in clouds)
        if not finite:  # a reader goes by the CRC alone
            raise BadInputError(f"track {track.name}: has points that are not finite; drop these.")
        self._check_truth(track)
        self._names.add(track.name)

    def _check_truth(self, track: Track) -> None:
        size = track.label_size_m
        if size is not None and not (len(size) == 3 and all(0 < side < math.inf for side in size)):
            raise BadInputError(
                f"track {track.name}: label_size_m is {size}, expected length, width and height."
            )
        kinds = get_args(ShapeKind)
        if track.shape_kind not in kinds:
            raise BadInputError(
                f"track {track.name}: shape_kind is {track.shape_kind!r}, expected"
                f" {', '.join(kinds[:-1])} or {kinds[-1]}."
            )
        if track.T_sensor_object is not None:
            try:
                SE3.from_matrix(track.T_sensor_object.matrix.detach().cpu())
            except BadInputError as error:
                raise BadInputError(f"track {track.name}: {error}") from error

    def _add_truth(self, poses: SE3 | None, shape: Float32[np.ndarray, "n 3"] | None) -> None:
        index = self._index
        index.append("pose_starts", -1 if poses is None else index.count("poses") // 12)
        if poses is not None:
            index.extend("poses", poses.matrix[:, :3].detach().cpu().numpy())
        index.append("shape_sizes", 0 if shape is None else len(shape))
        start, crc = (-1, 0) if shape is None else self._write(shape)
        index.append("shape_starts", start)
        index.append("shape_crcs", crc)

    def _add_rays(self, rays: SightLines) -> None:
        """Of the scan that comes next."""
        index, rows = self._index, rows_of_rays(rays)
        index.append("ray_scans", index.count("scan_sizes"))
        index.append("ray_counts", len(rays))
        index.append("ray_rows", len(rows))
        start, crc = self._write(rows)
        index.append("ray_starts", start)
        index.append("ray_crcs", crc)

    def _write(self, points: Float32[np.ndarray, "n 3"]) -> tuple[int, int]:
        """Append a cloud to the shard; returns its first row and its CRC."""
        assert self._shard is not None
        points = np.ascontiguousarray(points, "<f4")
        self._shard.write(points)
        start = self._points
        self._points += len(points)
        return start, cloud_crc(points)

    def _end_shard(self) -> None:
        assert self._shard is not None
        self._shards.append(self._shard.finish())
        self._index.append("shard_starts", self._points)
        self._shard = None

    def _abandon(self) -> None:
        self._index.abandon()
        if self._shard is not None:
            self._shard.abandon()


class _Shard:
    """One `points` tensor of a length that is known at the end only: the header keeps its room."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.points = 0
        self._temporary = path.with_name(path.name + ".part")
        self._file = self._temporary.open("wb")
        self._file.write(bytes(_HEADER_BYTES))

    def write(self, points: Float32[np.ndarray, "n 3"]) -> None:
        with naming(self.path):
            self._file.write(points.data)
        self.points += len(points)

    def finish(self) -> FileRecord:
        offsets = [0, self.points * POINT_BYTES]
        tensor = {"dtype": "F32", "shape": [self.points, 3], "data_offsets": offsets}
        header = json.dumps({"points": tensor}).encode().ljust(_HEADER_BYTES - 8)
        with naming(self.path):
            self._file.seek(0)
            self._file.write(len(header).to_bytes(8, "little") + header)
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        self._temporary.replace(self.path)
        return file_record(self.path)

    def abandon(self) -> None:
        with suppress(OSError):  # what a full disk did not take is tried again, and named no more
            self._file.close()


def check_room(path: Path, *, overwrite: bool) -> None:
    """Refuse an output where something else is, or a store that must not be replaced.

    Raises:
        BadInputError: either.
    """
    if not path.exists() or (path.is_dir() and set(path.iterdir()) <= set(path.glob(".*.part"))):
        return  # nothing, or what a writer left that was killed before it had begun
    ours = path.is_dir() and any((path / name).exists() for name in (INDEX_JSON, WRITING_JSON))
    if not ours:
        raise BadInputError(f"{path}: exists and is no packed store; choose another output.")
    if not overwrite:
        state = "a packed store" if (path / INDEX_JSON).exists() else "a half-written packed store"
        raise BadInputError(f"{path}: {state} is there already; pass --overwrite to replace it.")


def remove_store(path: Path, *, parts: bool = True) -> None:
    """Remove a store, finished or half-written: its own files, no others.

    `parts`: the finished parts of a conversion, too.
    """
    # The store ends to exist with its manifest, which therefore goes first.
    own = (INDEX_JSON, JOINING_JSON, INDEX_TENSORS, "points-*.safetensors*", ".*.part")
    for file in [file for pattern in own for file in path.glob(pattern)]:
        file.unlink()
    if parts:
        shutil.rmtree(path / PARTS, ignore_errors=True)
