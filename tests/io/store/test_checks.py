# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A store of which any bit is another is refused, or read as it was written."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from tests.io.older_store import make_older, reseal
from tests.io.store.stores import assert_holds, content, make_parts, with_gaps

from wildshape.errors import BadInputError
from wildshape.io.store import checks as store_checks
from wildshape.io.store.join import join_stores
from wildshape.io.store.layout import INDEX_JSON, INDEX_TENSORS
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.records import Track

FLIPS = 100


@pytest.fixture(params=["new", "older"])
def path(request, track: Track, tmp_path: Path) -> Path:
    path = tmp_path / "store"
    with StoreWriter(path, {"command": "a test", "parts": [{"n": 1.5}]}, shard_bytes=1500) as made:
        for name in "abc":
            made.add(with_gaps(track, name))
    if request.param == "older":
        make_older(path)
    return path


def places(file: Path, rng: np.random.Generator) -> list[int]:
    """Bits of a file, some of them in its header."""
    bits = 8 * file.stat().st_size
    return [*rng.integers(bits, size=FLIPS), *rng.integers(min(bits, 8 * 300), size=FLIPS // 2)]


def test_every_flipped_bit_is_seen_where_it_is_read(path: Path) -> None:
    rng, whole = np.random.default_rng(1), list(content(open_store(path)))
    for file in sorted(path.iterdir()):
        good = file.read_bytes()
        for place in places(file, rng):
            bad = bytearray(good)
            bad[place // 8] ^= 1 << place % 8
            file.write_bytes(bad)
            try:
                store = open_store(path)
                same = list(content(store)) == whole
            except BadInputError as error:
                older = "checksum" not in json.loads(good) if file.name == INDEX_JSON else False
                assert str(path if older else file) in str(error), (file.name, place)  # noqa: PT017
                assert "\n" not in str(error)  # noqa: PT017
            else:
                assert same, (file.name, place)
        file.write_bytes(good)
    assert list(content(open_store(path))) == whole


def test_a_flipped_point_is_named_and_the_rest_can_be_read(track: Track, tmp_path: Path) -> None:
    path = tmp_path / "store"
    with StoreWriter(path, {}, shard_bytes=1 << 20) as writer:
        writer.add(track)
    shard = path / "points-00000.safetensors"
    bad = bytearray(shard.read_bytes())
    bad[256 + 12 * 70] ^= 64  # of the second scan
    shard.write_bytes(bad)
    store = open_store(path)
    np.testing.assert_array_equal(store.scan_points(0), track.scans[0])
    np.testing.assert_array_equal(store.scan_points(2), track.scans[2])
    for _ in range(2):
        with pytest.raises(BadInputError, match=r"points-00000\.safetensors: the points of scan 1"):
            store.scan_points(1)


def test_a_cloud_is_compared_once(path: Path, monkeypatch) -> None:
    counted = []
    for check in (store_checks.cloud_crc, store_checks.is_finite):
        monkeypatch.setattr(
            f"wildshape.io.store.store.{check.__name__}",
            lambda points, check=check: counted.append(1) or check(points),
        )
    store = open_store(path)
    for _ in range(3):
        assert len(list(content(store))) == 1 + 3 * 3 + sum(len(t.scans) for t in store)
    assert len(counted) == store.scan_count + sum(t.shape is not None for t in store)


def test_files_of_older_stores_are_compared_once_a_process(path: Path, monkeypatch) -> None:
    compared = []
    real = store_checks.complaint
    monkeypatch.setattr(store_checks, "complaint", lambda *a: compared.append(a[0]) or real(*a))
    monkeypatch.setattr(store_checks, "_SETTLED_S", 0.0)
    store_checks._known_complaint.cache_clear()
    for _ in range(3):
        assert len(list(content(open_store(path)))) > 3
    shards = len(list(path.glob("points-*")))
    older = "scan_crcs" not in load_file(path / INDEX_TENSORS)
    assert len(compared) == (1 + shards if older else 1)


def test_a_changed_file_is_compared_again(path: Path) -> None:
    assert len(open_store(path)) == 3
    index = path / INDEX_TENSORS
    bad = bytearray(index.read_bytes())
    bad[-1] ^= 1
    index.write_bytes(bad)
    with pytest.raises(BadInputError, match=r"index\.safetensors: the checksum is wrong"):
        open_store(path)


def test_points_that_are_no_numbers_are_not_written(track, tmp_path) -> None:
    scan = track.scans[0].copy()
    scan[3, 1] = np.nan
    infinite = track.scans[0] * np.float32(np.inf)
    with StoreWriter(tmp_path / "store", {}) as writer:
        for bad in (
            Track("a", (scan,), ("a",)),
            Track("b", track.scans[:1], ("a",), shape=infinite),
        ):
            with pytest.raises(BadInputError, match=f"track {bad.name}: .* not finite"):
                writer.add(bad)
        writer.add(Track("c", (np.full((2, 3), 1e30, np.float32),), ("a",)))
    assert open_store(tmp_path / "store").scan_points(0)[0, 0] == np.float32(1e30)


def test_points_that_are_no_numbers_are_refused_where_there_are_no_crcs(track, tmp_path) -> None:
    with StoreWriter(tmp_path / "store", {}) as writer:
        writer.add(track)
    (shard,) = (tmp_path / "store").glob("points-*")
    data = bytearray(shard.read_bytes())
    data[256:260] = np.float32(np.nan).tobytes()
    shard.write_bytes(data)
    make_older(tmp_path / "store")
    with pytest.raises(BadInputError, match="the points of scan 0"):
        open_store(tmp_path / "store").track(0)


CRAFTED = {
    "track_starts": [0, 99, 2, 7],
    "scan_sizes": [-1] * 7,
    "scan_starts": [1 << 62] * 7,
    "shard_starts": [0],
    "shape_sizes": [1 << 62] * 3,
    "pose_starts": [5] * 3,
    "text_starts": [0, -5, 3],
    "sensors": [1 << 30] * 3,
    "scan_names": [-1] * 7,
    "poses": np.full((6, 3, 4), np.nan),
}


@pytest.mark.parametrize("name", CRAFTED)
def test_an_index_made_to_mislead_is_refused_though_all_checksums_fit(path: Path, name) -> None:
    index = load_file(path / INDEX_TENSORS)
    index[name] = np.asarray(CRAFTED[name], index[name].dtype)
    save_file(index, path / INDEX_TENSORS)
    reseal(path)
    with pytest.raises(BadInputError, match=r"index\.safetensors") as refused:
        list(content(open_store(path)))
    assert "\n" not in str(refused.value)


def test_an_index_off_the_grid_of_its_numbers_is_read(path: Path) -> None:
    """safetensors pads its header, but need not: numbers may begin at any byte."""
    _, *before = content(open_store(path))
    data = (path / INDEX_TENSORS).read_bytes()
    header = 8 + int.from_bytes(data[:8], "little")
    shifted = (header - 7).to_bytes(8, "little") + data[8:header] + b" " + data[header:]
    (path / INDEX_TENSORS).write_bytes(shifted)
    reseal(path)
    _, *after = content(open_store(path))
    assert after == before


def test_parts_of_an_older_version_join_into_a_store_with_checksums(track, tmp_path) -> None:
    out = tmp_path / "store"
    parts = make_parts(track, out)
    make_older(parts[0])
    join_stores(parts, out, {})
    assert_holds(out, track, "abcd")
    assert {"scan_crcs", "shape_crcs"} <= load_file(out / INDEX_TENSORS).keys()
    shutil.rmtree(out)
    parts = make_parts(track, out)
    join_stores(parts, out, {})
    assert_holds(out, track, "abcd")
