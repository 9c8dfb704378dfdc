# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Stores joined are the store that one writer would have written, whatever stops the joining."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from safetensors.numpy import load_file, save
from tests.io.store.stores import assert_holds, make_parts, with_gaps
from tests.refusal import refused

from wildshape.io.store import index as store_index
from wildshape.io.store.join import finish_join, is_joining, join_stores
from wildshape.io.store.layout import JOINING_JSON
from wildshape.io.store.manifest import sealed
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.records import Track


def test_joined_parts_hold_what_went_in(track: Track, tmp_path: Path) -> None:
    out = tmp_path / "store"
    parts = make_parts(track, out)
    moved = sorted(file.stat().st_ino for part in parts for file in part.glob("points-*"))
    join_stores(parts, out, {"made": "here"})
    assert_holds(out, track, "abcd")
    assert open_store(out).provenance == {"made": "here"}
    assert sorted(file.stat().st_ino for file in out.glob("points-*")) == moved
    assert {file.name for file in out.iterdir()} == {
        "index.json",
        "index.safetensors",
        *(file.name for file in out.glob("points-*")),
    }


def test_the_index_is_an_ordinary_safetensors_file(track, tmp_path, monkeypatch) -> None:
    """Also where its columns have outgrown memory, and texts are no longer known."""
    prints = []
    for buffered, known in ((1 << 13, 1 << 16), (3, 1 << 16), (3, 2)):
        monkeypatch.setattr(store_index, "_BUFFERED", buffered)
        monkeypatch.setattr(store_index, "_TEXTS_KNOWN", known)
        path = tmp_path / f"{buffered}-{known}"
        with StoreWriter(path, {}) as writer:
            for name in "abc":
                writer.add(with_gaps(track, name))
        assert_holds(path, track, "abc")
        index = path / "index.safetensors"
        assert save(load_file(index)) == index.read_bytes()
        assert not list(path.glob(".*"))
        prints.append(open_store(path).fingerprint)
    assert prints[0] == prints[1] != prints[2]


def test_texts_of_all_parts_are_counted_together(track: Track, tmp_path: Path) -> None:
    """The last part's count was taken for that of all."""
    out = tmp_path / "store"
    parts = [out / ".parts" / f"{number}" for number in range(3)]
    for number, part in enumerate(parts):
        with StoreWriter(part, {}) as writer:
            for i, category in enumerate(("car", "van", "van")):
                writer.add(replace(track, name=f"{number}-{i}", category=category))
    join_stores(parts, out, {})
    store = open_store(out)
    assert list(store.how_often("categories").items()) == [("van", 6), ("car", 3)]
    assert store.how_often("sources") == {track.source: 9}
    assert list(store.how_often("sensors").values()) == [9]


@pytest.mark.parametrize("moves", [0, 1, 99])
def test_a_join_that_was_killed_is_gone_on_with(track, tmp_path, monkeypatch, moves) -> None:
    out = tmp_path / "store"
    parts = make_parts(track, out)
    left = iter([None] * moves)
    real = Path.replace

    def stop(self, target):
        if self.name.startswith("points-") and next(left, "stop") == "stop":
            raise KeyboardInterrupt
        return real(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", stop)
        if moves < 99:
            with pytest.raises(KeyboardInterrupt):
                join_stores(parts, out, {})
        else:
            join_stores(parts, out, {})
    if moves < 99:
        assert is_joining(out)
        refused(open_store, out, match="half-written")
        finish_join(out)
    assert not is_joining(out)
    assert_holds(out, track, "abcd")


def test_a_shard_that_is_lost_is_named(track: Track, tmp_path: Path) -> None:
    out = tmp_path / "store"
    parts = make_parts(track, out)
    plan = {"moves": [[".parts/no", "points-00000.safetensors"]], "manifest": {}}
    (out / JOINING_JSON).write_text(json.dumps(sealed(plan)))
    refused(finish_join, out, match=r"no: lost; .*--overwrite")
    assert all(part.exists() for part in parts)


@pytest.mark.parametrize(
    "move",
    [
        [".parts/../../private", "points-00000.safetensors"],
        ["/etc/private", "points-00000.safetensors"],
        [".parts/0/points-00000.safetensors", "../points-00000.safetensors"],
        [".parts/0/points-00000.safetensors", "points-00001.safetensors"],
        7,
    ],
)
def test_a_plan_moves_parts_to_shards_and_nothing_else(track, tmp_path, move) -> None:
    out = tmp_path / "store"
    make_parts(track, out)
    before = sorted(tmp_path.rglob("*"))
    (out / JOINING_JSON).write_text(json.dumps(sealed({"moves": [move], "manifest": {}})))
    refused(finish_join, out, match=r"joining\.json")
    assert sorted(tmp_path.rglob("*")) == sorted([*before, out / JOINING_JSON])


def test_a_damaged_plan_is_refused(track: Track, tmp_path: Path) -> None:
    out = tmp_path / "store"
    make_parts(track, out)
    for text in ("{}", "[]", '{"moves": [], "manifest": {"a": -Infinity}, "checksum": ""}'):
        (out / JOINING_JSON).write_text(text)
        refused(finish_join, out, match=r"joining\.json")


def test_equal_names_are_refused_before_anything_moves(track: Track, tmp_path: Path) -> None:
    out = tmp_path / "store"
    parts = make_parts(track, out, (("a", "c"), ("c",)))
    refused(join_stores, parts, out, {}, match="two tracks are named 'c'")
    assert all(len(open_store(part)) for part in parts)
