# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import gc
import json
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.disk import full_disk
from tests.io.store.stores import assert_same
from tests.refusal import refused
from tests.stopping import stopped_at

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.store.index import IndexWriter
from wildshape.io.store.store import Store, StoreWriter, is_store, open_store
from wildshape.records import Sensor, Track


def _tracks(track: Track) -> list[Track]:
    """Tracks with and without truth, of 1 to 3 scans, one of them of one point."""
    bare = Track("bare", (track.scans[1],), ("x",), Sensor("lidar", (0.2, 0.4)))
    sparse = Track("sparse scan", (track.scans[0], track.scans[0][:1]), ("a", "b"))
    return [track, bare, sparse, replace(track, name="again", shape=None)]


@pytest.fixture
def store(track: Track, tmp_path: Path) -> Store:
    with StoreWriter(tmp_path / "store", {"seed": 1}, shard_bytes=1000) as writer:
        for each in _tracks(track):
            writer.add(each)
    return open_store(tmp_path / "store")


def test_round_trip(store: Store, track: Track) -> None:
    assert len(store) == 4
    assert store.names == ("car-1", "bare", "sparse scan", "again")
    for found, truth in zip(store, _tracks(track), strict=True):
        assert_same(found, truth)


def test_global_scan_index(store: Store, track: Track) -> None:
    assert store.track_starts.tolist() == [0, 3, 4, 6, 9]
    assert store.scan_sizes.tolist() == [60, 20, 33, 20, 60, 1, 60, 20, 33]
    np.testing.assert_array_equal(store.scan_points(7), track.scans[1])
    np.testing.assert_array_equal(store.scan_points(-1), track.scans[2])
    for wrong in (9, -10):
        with pytest.raises(IndexError):
            store.scan_points(wrong)
    with pytest.raises(IndexError):
        store.track(4)
    assert store.provenance == {"seed": 1}
    assert store.sensor_of(1) == Sensor("lidar", (0.2, 0.4))


def test_points_are_views_that_torch_takes_and_that_never_reach_the_disk(store: Store) -> None:
    view = store.scan_points(0)
    assert view.base is not None
    tensor = torch.from_numpy(view)  # would warn, so fail here, were the view read-only
    tensor += 1
    assert torch.equal(torch.from_numpy(store.scan_points(0)), tensor)
    store.verify()
    assert not np.array_equal(open_store(store.path).scan_points(0), view)


def test_shards_are_ordinary_safetensors(store: Store) -> None:
    from safetensors.numpy import load_file

    shards = sorted(store.path.glob("points-*.safetensors"))
    assert len(shards) > 1
    assert sum(len(load_file(shard)["points"]) for shard in shards) == 307 + 60
    assert load_file(store.path / "index.safetensors")["poses"].shape == (6, 3, 4)


def test_several_processes_and_pickling(store: Store) -> None:
    assert pickle.loads(pickle.dumps(store)).fingerprint == store.fingerprint
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        sums = list(pool.map(_sum, [store] * 4, range(4)))
    assert sums == [float(store.scan_points(i).sum()) for i in range(4)]


def _sum(store: Store, scan: int) -> float:
    return float(store.scan_points(scan).sum())


def test_fingerprint_is_of_the_contents_alone(track: Track, tmp_path: Path) -> None:
    prints = []
    for name, changed in (("a", track), ("b", track), ("c", replace(track, category="van"))):
        with StoreWriter(tmp_path / name, {"made": name}) as writer:
            writer.add(changed)
        prints.append(open_store(tmp_path / name).fingerprint)
    assert prints[0] == prints[1] != prints[2]


def test_verify_names_the_damaged_file(store: Store) -> None:
    shard = store.path / "points-00001.safetensors"
    data = bytearray(shard.read_bytes())
    data[-1] ^= 1
    shard.write_bytes(data)
    with pytest.raises(BadInputError, match=r"points-00001\.safetensors: the checksum is wrong"):
        open_store(store.path).verify()


def test_a_full_disk_names_the_shard(tmp_path: Path) -> None:
    cloud, shard = np.ones((10_000, 3), np.float32), tmp_path / "points-00000.safetensors"
    with full_disk(50_000, shard), StoreWriter(tmp_path, {}) as writer:
        writer.add(Track("large", (cloud,), ("0",)))


def test_a_full_disk_names_a_column_of_the_index(tmp_path: Path) -> None:
    writer = IndexWriter(tmp_path)
    with full_disk(50_000, tmp_path / ".scan_sizes.part"):
        writer.extend("scan_sizes", np.zeros(10_000, np.int64))


def test_half_written_stores_are_refused(track: Track, tmp_path: Path) -> None:
    path = tmp_path / "store"

    def stop() -> None:
        with StoreWriter(path, {}) as writer:
            writer.add(track)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert is_store(path)
    refused(open_store, path, match="half-written")
    refused(StoreWriter, path, {}, match=r"half-written.*--overwrite")
    with StoreWriter(path, {}, overwrite=True) as writer:
        writer.add(track)
    assert len(open_store(path)) == 1
    names = sorted(file.name for file in path.iterdir())
    assert names == ["index.json", "index.safetensors", "points-00000.safetensors"]


@pytest.mark.parametrize("removed", range(4))
def test_a_removal_that_was_stopped_is_repeated(
    store: Store, track: Track, monkeypatch: pytest.MonkeyPatch, removed: int
) -> None:
    """What was left was no store, and `--overwrite` was refused for good."""
    with stopped_at(Path, "unlink", removed, monkeypatch):
        StoreWriter(store.path, {}, overwrite=True)
    if removed:
        refused(open_store, store.path, match="half-written")
    else:
        open_store(store.path).verify()  # nothing was removed yet
    with StoreWriter(store.path, {}, overwrite=True) as writer:
        writer.add(track)
    assert open_store(store.path).names == ("car-1",)


def test_output_that_exists_is_refused(store: Store, tmp_path: Path, track: Track) -> None:
    refused(StoreWriter, store.path, {}, match="--overwrite")
    assert len(open_store(store.path)) == 4
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "thesis.txt").write_text("")
    refused(StoreWriter, tmp_path / "notes", {}, overwrite=True, match="no packed store")
    assert (tmp_path / "notes" / "thesis.txt").exists()


def test_a_store_has_one_writer_at_a_time(track: Track, tmp_path: Path) -> None:
    path = tmp_path / "store"
    first = StoreWriter(path, {})
    first.add(track)
    for overwrite in (False, True):
        refused(StoreWriter, path, {}, overwrite=overwrite, match="another writer of this process")
    first.close()
    assert open_store(path).names == ("car-1",)
    with pytest.raises(ZeroDivisionError), StoreWriter(path, {}, overwrite=True):
        raise ZeroDivisionError
    forgotten = StoreWriter(path, {}, overwrite=True)
    del forgotten
    gc.collect()
    with StoreWriter(path, {}, overwrite=True) as writer:
        writer.add(replace(track, name="car-2"))
    assert open_store(path).names == ("car-2",)


def test_bad_tracks_and_empty_stores_are_refused(track: Track, tmp_path: Path) -> None:
    writer = StoreWriter(tmp_path / "store", {})
    refused(writer.close, match="no track")
    with pytest.raises(BadInputError, match="3 scans, 2 names"):
        writer.add(replace(track, scan_names=("a", "b")))
    with pytest.raises(BadInputError, match="2 poses"):
        writer.add(replace(track, T_sensor_object=SE3.identity(2)))
    with pytest.raises(BadInputError, match="0 scans"):
        writer.add(replace(track, scans=(), scan_names=(), T_sensor_object=None))
    writer.add(track)
    refused(writer.add, track, match="two tracks are named 'car-1'")
    writer.close()
    assert len(open_store(tmp_path / "store")) == 1


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"T_sensor_object": SE3.identity(0)}, "0 poses do not fit"),
        ({"T_sensor_object": SE3.identity()}, "single poses do not fit"),  # one alone, not a batch
        ({"T_sensor_object": SE3(torch.zeros(3, 3, 3), torch.zeros(3, 3))}, "no rotation"),
        ({"T_sensor_object": SE3(torch.eye(3).expand(3, 3, 3), torch.ones(3, 3) / 0)}, "NaN"),
        ({"label_size_m": (4.0, 0.0, 1.5)}, "label_size_m"),
        ({"label_size_m": (4.0, np.nan, 1.5)}, "label_size_m"),
        ({"label_size_m": (4.0, np.inf, 1.5)}, "label_size_m"),
        ({"shape_kind": "nonsense"}, "shape_kind is 'nonsense', expected whole, mirrored or"),
        ({"scans": (np.ones((5, 3)), np.ones((0, 3)), np.ones((5, 3)))}, "a scan without points"),
        ({"shape": np.ones((0, 3), np.float32)}, "a shape without points"),
        ({"scans": (np.zeros((5, 4), np.float32),) * 3}, "x, y, z"),
        ({"scans": (np.full((5, 3), 1e300),) * 3}, "not finite"),
    ],
)
def test_what_no_reader_would_take_is_refused_and_the_rest_is_kept(
    changes: dict, said: str, track: Track, tmp_path: Path
) -> None:
    """A store of which one track has a box without a size was written, and never opened."""
    bad = Track("bad", track.scans, track.scan_names)
    vars(bad).update(changes)  # past the types, which are checked under pytest alone
    with StoreWriter(tmp_path / "store", {}) as writer:
        refused(writer.add, bad, match=f"^track bad: .*{said}")
        writer.add(track)
    assert open_store(tmp_path / "store").names == ("car-1",)
    open_store(tmp_path / "store").track(0)


def test_a_store_is_closed_once(
    track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second time its index was written without the columns that lay on the disk."""
    monkeypatch.setattr("wildshape.io.store.index._BUFFERED", 3)
    with StoreWriter(tmp_path / "store", {}) as writer:
        writer.add(track)
        writer.close()
        with pytest.raises(ValueError, match="closed"):
            writer.add(replace(track, name="late"))
    assert open_store(tmp_path / "store").names == ("car-1",)


def _rewrite(path: Path, **changes) -> None:
    data = json.loads((path / "index.json").read_text())
    (path / "index.json").write_text(json.dumps(data | changes))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"version": 2}, "expected wildshape-store version 1, found wildshape-store version 2"),
        ({"format": "zip"}, "found zip version 1"),
        ({"index": {}}, "damaged"),
        ({"provenance": {"seed": 2}}, "checksum is wrong"),
        ({"shards": []}, "checksum is wrong"),
    ],
)
def test_other_versions_and_damaged_manifests(changes: dict, said: str, store: Store) -> None:
    _rewrite(store.path, **changes)
    refused(open_store, store.path, match=said)


def test_truncation_is_seen_on_opening(store: Store) -> None:
    shard = store.path / "points-00000.safetensors"
    shard.write_bytes(shard.read_bytes()[:-100])
    refused(open_store, store.path, match=r"points-00000\.safetensors: expected \d+ bytes")
    shard.unlink()
    refused(open_store, store.path, match="found 0")


def test_no_store(tmp_path: Path) -> None:
    refused(open_store, tmp_path, match="no packed store")
