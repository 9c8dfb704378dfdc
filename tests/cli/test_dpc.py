# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC-LIDAR from `train` to a row of `evaluate`, at toy sizes."""

import json
from dataclasses import replace
from typing import get_args

import pytest

from wildshape.baselines.dpc import objective as dpc
from wildshape.cli.commands.train import Preset
from wildshape.training import recipes


@pytest.fixture
def toy_sizes(monkeypatch):
    base = dpc.PRESETS["dpc-lidar-small"]
    network = replace(base.network, image=16, voxels=8, points=50, channels=4, code=16)
    toy = replace(base, network=network, views=replace(base.views, tracks=2, points=64))
    monkeypatch.setitem(dpc.PRESETS, "dpc-lidar-small", toy)


def test_the_command_knows_all_presets():
    assert set(get_args(get_args(Preset)[0])) == set(recipes.PRESETS) | set(dpc.PRESETS)


def test_train_and_evaluate(wildshape, refused, store, toy_sizes, tmp_path):
    run, out = tmp_path / "dpc", tmp_path / "e"
    order = ("train", store, "--out", run, "--preset", "dpc-lidar-small", "--steps", 2)
    assert "dpc-lidar-small is trained, 2 steps" in wildshape(*order, "--device", "cpu").out
    assert "2 steps" in wildshape(*order, "--device", "cpu", "--resume").out
    measure = ("evaluate", store, "--out", out, "--max-scans", 2, "--baselines", "identity")
    assert "| dpc |" in wildshape(*measure, "--model", run, "--device", "cpu").out
    about = json.loads((out / "metrics.json").read_text())["methods"]["dpc"]["about"]
    assert "radial offset" in about
    again = ("evaluate", store, "--out", tmp_path / "f", "--as-seeds", "--model", run)
    other = tmp_path / "other.safetensors"
    other.write_bytes((run / "model.safetensors").read_bytes())
    assert "trained DPC" in refused(*again, other)
    taught = ("train", store, "--out", tmp_path / "taught", "--preset", "tiny", "--teacher", run)
    assert "for evaluate alone" in refused(*taught)


def test_what_dpc_has_not_is_refused_and_leaves_nothing(refused, store, tmp_path):
    out = tmp_path / "run"
    order = ("train", store, "--out", out, "--device", "cpu", "--preset")
    assert "--teacher" in refused(*order, "dpc-lidar", "--teacher", "truth")
    assert "--encoder" in refused(*order, "dpc-lidar", "--encoder", "dgcnn")
    assert "choose dpc-lidar" in refused(*order, "dpc")
    assert not out.exists()
