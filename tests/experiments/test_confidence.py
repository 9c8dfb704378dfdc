# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the confidence is calibrated on: every kind of vehicle, another choice a sensor."""

from collections import Counter

import pytest
from experiments.confidence import Settings, drives
from tests.cars import drive_by

from experiments import confidence
from wildshape.io.store.store import is_finished_store
from wildshape.simulate.shapes.meshes import mesh_files

KINDS = {"bus": 2, "car": 30, "truck": 20}


@pytest.fixture
def meshes(tmp_path, monkeypatch):
    """By sensor the meshes that `drives` takes of many; nothing is simulated."""
    names = [f"{kind}-{number}" for kind, count in KINDS.items() for number in range(count)]
    rows = [{"category": name.split("-")[0], "file": f"{name}.ply"} for name in names]
    taken = {}

    def made(config, seed, workers):
        if config.meshes:
            files = mesh_files(config.meshes)[: config.tracks]
            taken[config.sensor] = [path.stem.split("_")[1] for path in files]
        yield drive_by(scans=2, points=60)

    monkeypatch.setattr(confidence, "rows_of", lambda cad, split: rows)
    monkeypatch.setattr(confidence, "simulate_tracks", made)

    def choice(out):
        drives(Settings(tmp_path / out, cad=tmp_path))
        return dict(taken)

    return choice


def test_a_few_tracks_are_of_every_common_kind_and_each_sensor_sees_others(meshes):
    found = meshes("one")
    for names in found.values():
        kinds = Counter(name.split("-")[0] for name in names)
        assert kinds.total() == Settings.tracks
        assert min(kinds["car"], kinds["truck"]) >= Settings.tracks // 5
    one, other = map(set, found.values())
    assert len(one - other) > Settings.tracks // 4
    assert meshes("another") == found


def test_drives_that_a_stop_left_half_made_are_made_again(meshes, monkeypatch, half_written):
    def left_half_made(path):
        half_written(path)
        return is_finished_store(path)

    monkeypatch.setattr(confidence, "is_finished_store", left_half_made)
    assert set(meshes("one")) == {"hdl64", "hdl32"}


def test_another_category_in_the_same_folder_is_not_calibrated_on_drives(tmp_path):
    assert {track.category for track in drives(Settings(tmp_path, tracks=1))} == {"car"}
    chairs = drives(Settings(tmp_path, tracks=1, category="chair"))
    assert {track.category for track in chairs} == {"chair"}
    assert len(drives(Settings(tmp_path, tracks=2, category="chair"))) == 2


def test_weights_do_not_speak_of_meshes_that_were_not_there(tmp_path):
    alone = "simulated views with their truth: procedural chairs"
    assert Settings(tmp_path, category="chair").fitted_on == alone
    assert Settings(tmp_path, cad=tmp_path, category="chair").fitted_on == (
        f"{alone}, CAD chairs of split train"
    )
