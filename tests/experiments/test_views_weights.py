# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Weights for depth views: the data are whole before anything is trained."""

from pathlib import Path

import pytest
from experiments.views_weights import Settings, main, ship
from tests.models import CONFIG, SETTINGS

from experiments import views_weights
from wildshape.errors import BadInputError
from wildshape.io.store.store import open_store
from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.method.network import ShapePoseNet


def test_views_that_a_stop_left_half_made_are_made_again(cad, tmp_path, monkeypatch, half_written):
    trained = []
    monkeypatch.setattr(views_weights, "train", lambda *of: trained.append(of))
    monkeypatch.setattr(views_weights, "ship", lambda *of: None)
    monkeypatch.setattr(views_weights, "_COPIES", 1)
    half_written(tmp_path / "data")
    main(Settings(tmp_path, cad, "car"))
    assert len(open_store(tmp_path / "data")) == 3
    assert len(trained) == 1


def test_weights_of_a_category_are_not_made_of_anothers_views(cad, tmp_path, monkeypatch):
    monkeypatch.setattr(views_weights, "train", lambda *of: None)
    monkeypatch.setattr(views_weights, "ship", lambda *of: None)
    monkeypatch.setattr(views_weights, "_COPIES", 1)
    main(Settings(tmp_path, cad, "car"))
    with pytest.raises(BadInputError, match="holds views of cars"):
        main(Settings(tmp_path, cad, "chair"))


def test_weights_say_the_command_that_makes_them_again(tmp_path):
    save_checkpoint(tmp_path / "model.safetensors", ShapePoseNet(CONFIG), SETTINGS)
    settings = Settings(tmp_path, Path("cad"), "car", taught_steps=9, taught_lr=1e-4, seed=3)
    ship(tmp_path / "model.safetensors", settings)
    made = load_checkpoint(tmp_path / "car.safetensors")[1].provenance["command"]
    assert "--steps 3500 --taught-steps 9 --taught-lr 0.0001 --seed 3" in made
