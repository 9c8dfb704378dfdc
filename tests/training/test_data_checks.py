# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Data that cannot teach are told before the training, and others are not."""

from dataclasses import replace

import pytest

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
    assert doubts("views", replace(cars[0], sensor=Sensor("camera"))) == []


def test_tracks_without_two_usable_scans_are_doubted(doubts, cars):
    (said,) = doubts("small", cars[0].part([0]), cars[1].part([3]))
    assert "no track has two scans of 100 points or more" in said
    two = cars[0].part([0, 1])
    sparse = replace(two, scans=(two.scans[0], two.scans[1][:99]))
    assert len(doubts("small", sparse)) == 1
    assert doubts("small", two) == []


def test_a_training_says_so(cars, tmp_path):
    class Heard(Silent):
        def say(self, text):
            heard.append(text)

    heard: list[str] = []
    with StoreWriter(tmp_path / "store", {}) as writer:
        writer.add(cars[0].part([0]))
    train(tmp_path / "store", tmp_path / "run", TrainingOptions("tiny", steps=1), Heard())
    assert [text for text in heard if "no track has two scans" in text]
