# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders and the packed store as sources."""

import pickle
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from tests.cars import drive_by
from tests.fuzz.drives import TARGETS

from wildshape.datasets.sources import SOURCES, open_source
from wildshape.datasets.tracks.source import Source, all_tracks
from wildshape.datasets.tracks.whole_tracks import Folder, Packed
from wildshape.errors import BadInputError
from wildshape.io.store.store import StoreWriter
from wildshape.io.tracks import write_track


def test_folder_yields_tracks_in_order_and_counts_bad_scans(tmp_path):
    for name in ("b", "a"):
        write_track(tmp_path / name, drive_by(name, scans=3, points=50))
    broken = tmp_path / "a" / "scans" / "000001.ply"
    broken.write_bytes(b"ply\nbroken")
    (tmp_path / "c" / "scans").mkdir(parents=True)
    empty = [tmp_path / "c" / "scans" / name for name in ("0.npy", "1.npy")]
    for file in empty:
        file.write_bytes(b"")
    source = Folder(tmp_path)
    tracks = list(all_tracks(source))
    assert [track.name for track in tracks] == ["a", "b"]
    assert tracks[0].scan_names == ("000000", "000002")
    assert source.rejected == {
        f"scan: {broken}: the PLY header line 'broken' makes no sense; write it again.": 1,
        f"scan: {empty[0]}: is empty (0 bytes); write or copy it again.": 2,  # the first is named
        "object: no scan that can be used": 1,
    }
    assert [track.name for track in all_tracks(Folder(tmp_path / "b"))] == ["b"]


def test_folder_without_tracks_is_refused(tmp_path):
    with pytest.raises(BadInputError, match="found no scans"):
        list(all_tracks(Folder(tmp_path)))


def test_packed_gives_back_what_was_written(tmp_path):
    written = [drive_by(name, scans=2, points=50, seed=i) for i, name in enumerate("ab")]
    store = StoreWriter(tmp_path / "store", {"source": "test"})
    for track in written:
        store.add(track)
    store.close()
    for track, read in zip(written, all_tracks(Packed(tmp_path / "store")), strict=True):
        assert read.name == track.name
        assert np.array_equal(read.scans[1], track.scans[1])


@pytest.mark.parametrize("name", SOURCES)
def test_every_reader_is_a_source_and_travels_to_workers(tmp_path, name):
    source = open_source(name, tmp_path, {"every": 2})
    assert isinstance(source, Source)
    assert pickle.loads(pickle.dumps(source)) == source


def test_every_data_set_is_fuzzed_and_listed():
    page = Path(__file__).parents[2] / "docs" / "datasets" / "README.md"
    listed = re.findall(r"^\|[^|]+\| `([\w-]+)` \|", page.read_text("utf-8"), re.MULTILINE)
    assert set(listed) == set(SOURCES)
    assert {target.name for target in TARGETS} == set(SOURCES) - {"folder", "packed"}


@dataclass(frozen=True)
class Own:
    number: int = 1


@dataclass
class Added:
    root: Path
    own: Own = Own()


def test_options_of_any_record_of_a_reader_are_set(tmp_path, monkeypatch):
    monkeypatch.setitem(SOURCES, "added", f"{__name__}:Added")
    assert open_source("added", tmp_path, {"number": 2}) == Added(tmp_path, Own(2))
