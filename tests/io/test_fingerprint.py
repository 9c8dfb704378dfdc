# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A fingerprint follows the files that are read, and nothing else."""

import shutil

import pytest

from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.store.store import open_store
from wildshape.io.write_tracks import write_tracks


@pytest.fixture
def dataset(cars, tmp_path):
    """Two track folders."""
    write_tracks(cars[:2], tmp_path / "data", "folders", command="x", settings={})
    return tmp_path / "data"


def test_copies_are_alike_and_strangers_do_not_count(dataset, tmp_path):
    before = fingerprint_of(dataset)
    shutil.copytree(dataset, tmp_path / "copy")
    (dataset / "notes.txt").write_text("not read")
    (dataset / "run").mkdir()
    (dataset / "run" / "model.npy").write_text("not read")
    assert fingerprint_of(dataset) == before == fingerprint_of(tmp_path / "copy")


@pytest.mark.parametrize("name", ["track.json", "poses.txt", "shape.ply", "scans/000000.ply"])
def test_each_file_that_is_read_counts(dataset, cars, name):
    track = dataset / cars[0].name
    places = dataset, track, track / "scans", track / "scans" / "000000.ply"
    before = [fingerprint_of(place) for place in places]
    with (track / name).open("ab") as file:
        file.write(b" ")
    changed = [fingerprint_of(place) != was for place, was in zip(places, before)]
    assert changed == [True, True, *[name.startswith("scans")] * 2]


def test_a_file_as_large_as_before_counts(dataset, cars):
    scan = dataset / cars[0].name / "scans" / "000000.ply"
    before = fingerprint_of(dataset)
    scan.write_bytes(bytes(scan.stat().st_size))
    assert fingerprint_of(dataset) != before


def test_stores_and_what_drive_found_in_several_recordings_count(dataset, cars, tmp_path):
    write_tracks(cars[:2], tmp_path / "store", "packed", command="x", settings={})
    assert fingerprint_of(tmp_path / "store") == open_store(tmp_path / "store").fingerprint
    dataset.rename(tmp_path / "tracks")
    several = tmp_path / "found" / "one"
    several.mkdir(parents=True)
    (tmp_path / "tracks").rename(several / "tracks")
    before = fingerprint_of(several.parent)
    (several / "tracks" / cars[0].name / "scans" / "000000.ply").unlink()
    assert fingerprint_of(several.parent) != before
