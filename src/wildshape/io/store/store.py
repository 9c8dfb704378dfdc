# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store: tracks in few large files, memory-mapped (docs/formats.md)."""

import json
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float32, Int64

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import reading
from wildshape.io.sensor_json import sensor_from_json
from wildshape.io.store.checks import (
    check_file,
    check_file_once,
    check_index,
    cloud_crc,
    is_finite,
)
from wildshape.io.store.layout import (
    CRCS,
    CURE,
    EXTRAS,
    INDEX_JSON,
    INDEX_TENSORS,
    SHAPE_KINDS,
    WRITING_JSON,
    FileRecord,
    map_tensors,
)
from wildshape.io.store.manifest import files_of, read_manifest
from wildshape.io.store.rays import rays_of_rows
from wildshape.io.store.writer import StoreWriter
from wildshape.records import Sensor, ShapeKind, SightLines, Track

__all__ = ["Store", "StoreWriter", "is_store", "open_store"]


def is_store(path: Path | str) -> bool:
    """Whether a packed store, finished or half-written, lies at `path`."""
    return any((Path(path) / name).is_file() for name in (INDEX_JSON, WRITING_JSON))


def is_finished_store(path: Path | str) -> bool:
    """Whether a packed store lies at `path`, and not a half-written one."""
    return (Path(path) / INDEX_JSON).is_file()


def open_store(path: Path | str, named: Path | None = None) -> "Store":
    """Open a finished packed store for reading; costs milliseconds however large it is.

    Args:
        path: its folder.
        named: what a user calls its tracks, who did not pack them; by default the folder.

    Raises:
        BadInputError: no store, half-written, of another version, or damaged.
    """
    return Store(as_path(path, "path"), named)


class Store:
    """A packed store opened for reading; safe in several processes, pickled by its path.

    Attributes:
        path: its folder.
        named: what messages about its tracks call it.
        track_starts: `(T + 1,)` first scan of each track.
        scan_sizes: `(S,)` points of each scan.
        fingerprint: short hash of the contents (not of the provenance).
        provenance: how it was made.
    """

    def __init__(self, path: Path | str, named: Path | None = None) -> None:
        """Map the index; the shards follow when touched.

        Raises:
            BadInputError: see `open_store`.
        """
        self.path = path = as_path(path, "path")
        self.named = named or path
        manifest = read_manifest(path)
        self._files = files_of(manifest)
        for record in self._files:
            _check_size(path, record)
        check_file_once(path / INDEX_TENSORS, self._files[0])
        self._index = map_tensors(path / INDEX_TENSORS)
        check_index(self._index, manifest, path)
        self.track_starts: Int64[np.ndarray, "tracks+1"] = self._index["track_starts"]
        self.scan_sizes: Int64[np.ndarray, "scans"] = self._index["scan_sizes"]
        self.fingerprint: str = manifest["fingerprint"]
        self.provenance: dict[str, Any] = manifest["provenance"]
        self._shard_starts: list[int] = self._index["shard_starts"].tolist()
        self._shards: dict[int, Float32[np.ndarray, "n 3"]] = {}
        # Views of memory give whole numbers at a quarter of the price of numpy.
        self._crcs = {
            name.removesuffix("_crcs"): np.require(self._index[name], requirements="A").data
            for name in CRCS
            if name in self._index
        }
        self._checked = bytearray(len(self.scan_sizes) + len(self))  # scans, then shapes
        self._sensors: dict[int, Sensor] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return open_store, (self.path, self.named)

    def __len__(self) -> int:
        return len(self.track_starts) - 1

    def __iter__(self) -> Iterator[Track]:
        return (self.track(i) for i in range(len(self)))

    @property
    def scan_count(self) -> int:
        """Number of scans of all tracks."""
        return len(self.scan_sizes)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The tracks' names."""
        return tuple(self._text("track_names", i) for i in range(len(self)))

    def track(self, index: int) -> Track:
        """A track; its scans and shape are views of the mapped files, float32, metres.

        Raises:
            IndexError: there is no such track.
        """
        index = _inside(index, len(self), "track")
        scans = range(int(self.track_starts[index]), int(self.track_starts[index + 1]))
        return Track(
            name=self._text("track_names", index),
            scans=tuple(self.scan_points(s) for s in scans),
            scan_names=tuple(self._text("scan_names", s) for s in scans),
            sensor=self.sensor_of(index),
            category=self._text("categories", index),
            source=self._text("sources", index),
            T_sensor_object=self.poses_of(index),
            shape=self.shape_of(index),
            rays=tuple(self.rays_of(s) for s in scans) if self._rays else (),
            label_size_m=self._labels.get(index),
            shape_kind=self._shape_kinds.get(index, "whole"),
        )

    def scan_points(self, scan: int) -> Float32[np.ndarray, "n 3"]:
        """Points of scan number `scan` of the whole store: a view, metres, its sensor's frame.

        Raises:
            IndexError: there is no such scan.
            BadInputError: the points are not those that were written.
        """
        scan = _inside(scan, len(self.scan_sizes), "scan")
        points = self._rows(int(self._index["scan_starts"][scan]), int(self.scan_sizes[scan]))
        if not self._checked[scan]:
            self._check_cloud(points, "scan", scan)
            self._checked[scan] = True
        return points

    def rays_of(self, scan: int) -> SightLines | None:
        """The rays of scan number `scan` of the whole store; None if it has none.

        Raises:
            IndexError: there is no such scan.
            BadInputError: they are not those that were written.
        """
        row = self._rays.get(_inside(scan, len(self.scan_sizes), "scan"))
        if row is None:
            return None
        start, rows = (int(self._index[name][row]) for name in ("ray_starts", "ray_rows"))
        found = self._rows(start, rows)
        if cloud_crc(found) != int(self._index["ray_crcs"][row]):
            self._refuse(start, f"the rays of scan {scan}")
        return rays_of_rows(found, int(self._index["ray_counts"][row]))

    @cached_property
    def _rays(self) -> dict[int, int]:
        """Where among the rays those of a scan are."""
        return {scan: row for row, scan in enumerate(self.column("ray_scans").tolist())}

    @cached_property
    def _labels(self) -> dict[int, tuple[float, float, float]]:
        """Size of each track's labelled box, metres."""
        sizes = self.column("label_sizes").reshape(-1, 3).tolist()
        tracks = self.column("label_tracks").tolist()
        return {track: (x, y, z) for track, (x, y, z) in zip(tracks, sizes)}

    @cached_property
    def _shape_kinds(self) -> dict[int, ShapeKind]:
        return {i: kind for kind, name in SHAPE_KINDS.items() for i in self.column(name).tolist()}

    def shape_of(self, track: int) -> Float32[np.ndarray, "n 3"] | None:
        """Truth: surface points in the object frame, a view, metres; None if unknown.

        Raises:
            BadInputError: the points are not those that were written.
        """
        start = int(self._index["shape_starts"][track])
        if start < 0:
            return None
        points = self._rows(start, int(self._index["shape_sizes"][track]))
        place = len(self.scan_sizes) + track
        if not self._checked[place]:
            self._check_cloud(points, "shape", track)
            self._checked[place] = True
        return points

    def poses_of(self, track: int) -> SE3 | None:
        """Truth: `T_sensor_object`, one a scan; None if unknown.

        Raises:
            BadInputError: a pose is no rigid transform.
        """
        start = int(self._index["pose_starts"][track])
        if start < 0:
            return None
        count = int(self.track_starts[track + 1] - self.track_starts[track])
        try:
            return SE3.from_matrix(self._index["poses"][start : start + count].copy())
        except BadInputError as error:
            raise BadInputError(f"{self.path / INDEX_TENSORS}: {error} {CURE}.") from error

    def sensor_of(self, track: int) -> Sensor:
        """How a track was taken."""
        number = int(self._index["sensors"][track])
        if number not in self._sensors:
            with reading(self.path / INDEX_TENSORS, "the sensor of a track"):
                raw = json.loads(self._text("sensors", track))
            self._sensors[number] = sensor_from_json(raw, self.path)
        return self._sensors[number]

    def column(self, name: str) -> np.ndarray:
        """A column of the index (`layout.INDEX`, `EXTRAS`): a view of the mapped file.

        CRCs that an older version did not write are made of the points; extras that a store does
        not have are empty.

        Raises:
            BadInputError: these are not those that were written.
        """
        if name in EXTRAS and name not in self._index:
            return np.empty(0, EXTRAS[name])
        if name in self._index or name not in CRCS:
            return self._index[name]
        scans = name == "scan_crcs"
        read, count = (self.scan_points, self.scan_count) if scans else (self.shape_of, len(self))
        clouds = (read(i) for i in range(count))
        return np.array([0 if c is None else cloud_crc(c) for c in clouds], np.int64)

    def how_often(self, column: str) -> dict[str, int]:
        """Tracks that bear each text of `categories`, `sources` or `sensors`, most first."""
        _, rows, counts = np.unique(self._index[column], return_index=True, return_counts=True)
        found: Counter[str] = Counter()
        for row, count in zip(rows.tolist(), counts.tolist()):
            found[self._text(column, row)] += count  # a joined store has a text once a part
        return dict(found.most_common())

    def verify(self) -> None:
        """Read everything and compare the checksums.

        Raises:
            BadInputError: a file differs from what was written.
        """
        for record in self._files:
            check_file(self.path / record.file, record)

    def _check_cloud(self, points: Float32[np.ndarray, "n 3"], what: str, number: int) -> None:
        crcs = self._crcs.get(what)
        # A writer of CRCs takes numbers only. Without CRCs the shard was compared whole.
        if is_finite(points) if crcs is None else cloud_crc(points) == crcs[number]:
            return
        self._refuse(int(self._index[f"{what}_starts"][number]), f"the points of {what} {number}")

    def _refuse(self, start: int, what: str) -> NoReturn:
        file = self.path / self._files[self._shard_at(start) + 1].file
        raise BadInputError(
            f"{file}: {what} of the store are not those that were written;"
            f" the file is damaged: {CURE}."
        )

    def _rows(self, start: int, count: int) -> Float32[np.ndarray, "n 3"]:
        shard = self._shard_at(start)
        first = start - self._shard_starts[shard]
        return self._shard(shard)[first : first + count]

    def _shard_at(self, row: int) -> int:
        return min(bisect_right(self._shard_starts, row), len(self._shard_starts) - 1) - 1

    def _shard(self, number: int) -> Float32[np.ndarray, "n 3"]:
        if number not in self._shards:
            record = self._files[number + 1]
            path = self.path / record.file
            if "scan_crcs" not in self._index:
                check_file_once(path, record)
            points = map_tensors(path).get("points")
            rows = self._shard_starts[number + 1] - self._shard_starts[number]
            if points is None or points.shape != (rows, 3) or points.dtype != np.float32:
                raise BadInputError(f"{path}: does not hold the {rows} points of the index.")
            self._shards[number] = points
        return self._shards[number]

    def _text(self, column: str, row: int) -> str:
        number = int(self._index[column][row])
        start, end = self._index["text_starts"][number : number + 2].tolist()
        return self._index["text_bytes"][start:end].tobytes().decode("utf-8", "surrogateescape")


def _inside(index: int, count: int, what: str) -> int:
    if not -count <= index < count:
        raise IndexError(f"{what} {index} of {count}")
    return index % count


def _check_size(path: Path, record: FileRecord) -> None:
    file = path / record.file
    found = file.stat().st_size if file.is_file() else 0
    if found != record.bytes:
        raise BadInputError(
            f"{file}: expected {record.bytes} bytes, found {found}; copy the whole store again."
        )
