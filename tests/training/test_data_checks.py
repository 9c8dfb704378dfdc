# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Data that cannot teach are told before the training, and others are not."""

import sys
from dataclasses import replace

import pytest
from tests.packed import packed

from wildshape.io.progress import Silent
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.records import Sensor
from wildshape.training.data_checks import doubts_of
from wildshape.training.options import TrainingOptions
from wildshape.training.recipes import recipe_for
from wildshape.training.train import train


@pytest.fixture
def doubts(tmp_path):
    """Those of a preset on some tracks."""

    def told(preset, *tracks):
        with StoreWriter(tmp_path / "store", {}, overwrite=True) as writer:
            for number, track in enumerate(tracks):
                writer.add(replace(track, name=str(number)))
        store = open_store(tmp_path / "store")
        return doubts_of(store, recipe_for(store, preset, 1))

    return told


def unit_size(track):
    """As a depth camera sees it, its diagonal about 1."""
    return replace(track, sensor=Sensor("camera"), scans=tuple(scan / 5 for scan in track.scans))


@pytest.mark.parametrize("preset", ["small", "default", "paper-lidar"])
def test_tracks_of_the_presets_sensor_are_not_doubted(doubts, cars, preset):
    assert doubts(preset, cars[0], cars[1].part([0])) == []


def test_scans_of_another_sensor_are_doubted(doubts, cars):
    (said,) = doubts("views", cars[0])
    assert "lidar scans, but preset views" in said
    assert "are paper-lidar, default, small" in said
    (said,) = doubts("small", replace(cars[0], sensor=Sensor("camera")))
    assert "camera scans, but preset small" in said
    assert "are paper-views, views" in said
    assert doubts("views", unit_size(cars[0])) == []


def test_tracks_without_two_usable_scans_are_doubted(doubts, cars):
    (said,) = doubts("small", cars[0].part([0]), cars[1].part([3]))
    assert "no track has two scans of 100 points or more" in said
    two = cars[0].part([0, 1])
    sparse = replace(two, scans=(two.scans[0], two.scans[1][:99]))
    assert len(doubts("small", sparse)) == 1
    assert doubts("small", two) == []


def test_scans_that_are_not_trained_on_are_counted(doubts, cars):
    sparse = replace(cars[1], scans=tuple(scan[:99] for scan in cars[1].scans))
    (said,) = doubts("small", cars[0], sparse)
    count = len(sparse.scans)
    assert f"{count} of {count + len(cars[0].scans)} scans have fewer than 100 points" in said
    assert "1 of 2 tracks have no others" in said


def test_objects_of_another_size_than_the_presets_are_doubted(doubts, cars):
    """Cups in metres for a preset whose lengths are those of objects of unit size."""
    cup = replace(unit_size(cars[0]), scans=tuple(s / 50 for s in cars[0].scans))
    (said,) = doubts("views", cup)
    assert "but preset views has the lengths for objects of 0.4 to 2.5 m" in said
    assert doubts("views", unit_size(cars[0])) == []
    (said,) = doubts("small", replace(cars[0], scans=tuple(s / 10 for s in cars[0].scans)))
    assert "objects of 1 to 25 m" in said


def test_scans_about_their_own_middle_are_doubted(doubts, cars):
    """Crops are often centred before they are saved; where the sensor stood is lost then."""
    centred = tuple(scan - (scan.min(0) + scan.max(0)) / 2 for scan in cars[0].scans)
    (said,) = doubts("small", replace(cars[0], scans=centred))
    assert "the origin lies within most scans" in said


def test_a_training_says_so(cars, tmp_path):
    class Heard(Silent):
        def say(self, text):
            heard.append(text)

    heard: list[str] = []
    packed(tmp_path / "store", [cars[0].part([0])])
    train(tmp_path / "store", tmp_path / "run", TrainingOptions("tiny", steps=1), Heard())
    assert [text for text in heard if "no track has two scans" in text]


@pytest.mark.parametrize("teacher", ["truth", None])
def test_true_poses_the_wrong_way_round_are_told(cars, tmp_path, teacher):
    """An oracle would learn from them, and every validation measures by them."""

    class Heard(Silent):
        def say(self, text):
            heard.append(text)

    heard: list[str] = []
    poses = cars[0].T_sensor_object
    for name, T in (("sound", poses), ("turned", poses.inverse())):
        packed(tmp_path / name, [replace(cars[0], T_sensor_object=T)])
        options = TrainingOptions("tiny", steps=1, teacher=teacher)
        train(tmp_path / name, tmp_path / f"{name}.run", options, Heard())
    (said,) = (text for text in heard if "true poses" in text)
    assert said.startswith(f"{tmp_path / 'turned'}: ")


def test_training_needs_none_of_the_libraries_of_other_commands(tmp_path, car_store, monkeypatch):
    for name in ("scipy", "trimesh", "small_gicp", "skimage", "laspy", "matplotlib", "PIL"):
        for loaded in [one for one in sys.modules if one.split(".")[0] == name]:
            monkeypatch.delitem(sys.modules, loaded)
        monkeypatch.setitem(sys.modules, name, None)  # importing it is an ImportError
    run = tmp_path / "run"
    train(car_store.path, run, TrainingOptions("tiny", steps=1), Silent())
    assert (run / "model.safetensors").is_file()
