# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Stores in parts, and all that a store says."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from wildshape.io.store.layout import INDEX_JSON, PARTS, WRITING_JSON
from wildshape.io.store.store import Store, StoreWriter, open_store
from wildshape.records import Sensor, Track


def make_parts(track: Track, out: Path, names=(("a", "b"), ("c", "d"))) -> list[Path]:
    """Stores with and without truth, of one shard and of several."""
    (out / PARTS).mkdir(parents=True)
    (out / WRITING_JSON).write_text("{}")
    paths = []
    for number, group in enumerate(names):
        paths.append(out / PARTS / f"{number}")
        with StoreWriter(paths[-1], {}, shard_bytes=500 * (1 + 9 * number)) as writer:
            for name in group:
                writer.add(with_gaps(track, name))
    return paths


def with_gaps(track: Track, name: str) -> Track:
    bare = Track(name, (track.scans[1],), (f"x{name}",), Sensor("lidar", (0.2, 0.4)))
    if name in "bd":
        return bare
    return replace(track if name == "a" else _backwards(track), name=name, category=name)


def _backwards(track: Track) -> Track:
    """The same the other way round, so that nothing of it is what a track before it has there."""
    poses, shape = track.T_sensor_object, track.shape
    return replace(
        track,
        scans=track.scans[::-1],
        T_sensor_object=None if poses is None else poses[torch.arange(len(poses)).flip(0)],
        shape=None if shape is None else np.ascontiguousarray(shape[::-1]),
    )


def assert_holds(path: Path, track: Track, names: str) -> None:
    store = open_store(path)
    store.verify()
    assert "".join(store.names) == names
    for found, name in zip(store, names):
        assert_same(found, with_gaps(track, name))


def assert_same(found: Track, truth: Track) -> None:
    for what in ("name", "scan_names", "sensor", "category", "source"):
        assert getattr(found, what) == getattr(truth, what)
    for scan, points in zip(found.scans, truth.scans, strict=True):
        assert np.array_equal(scan, points)
    assert (found.shape is None) == (truth.shape is None)
    if found.shape is not None and truth.shape is not None:
        assert np.array_equal(found.shape, truth.shape)
    assert (found.T_sensor_object is None) == (truth.T_sensor_object is None)
    if found.T_sensor_object is not None and truth.T_sensor_object is not None:
        assert torch.equal(found.T_sensor_object.matrix, truth.T_sensor_object.matrix)


def content(store: Store) -> Iterator[bytes]:
    """All that a store says."""
    sealed = "checksum" in json.loads((store.path / INDEX_JSON).read_text())
    told = store.provenance if sealed else None
    yield repr((store.names, store.fingerprint, told)).encode()
    for track in store:
        said = (track.name, track.scan_names, track.sensor, track.category, track.source)
        yield repr(said).encode()
        yield from (scan.tobytes() for scan in track.scans)
        yield b"" if track.shape is None else track.shape.tobytes()
        poses = track.T_sensor_object
        yield b"" if poses is None else poses.matrix.numpy().tobytes()
