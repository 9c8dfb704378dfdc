# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The profile accounts for the whole step, and changes nothing."""

from dataclasses import replace

import pytest
import torch
from safetensors.torch import load_file
from tests.training.worker import SMALLEST

from wildshape.training.loop import fit, setup
from wildshape.training.runtime.profiler import PROFILE


def trained(store, folder, steps, *, profile):
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=steps))
    run = setup(recipe, store, folder, seed=1)
    run.profile = folder / PROFILE if profile else None
    return load_file(fit(run))


def test_stages_add_up_and_weights_stay_the_same(car_store, tmp_path):
    plain = trained(car_store, tmp_path / "plain", 6, profile=False)
    weights = trained(car_store, tmp_path / "profiled", 6, profile=True)
    assert all(torch.equal(weights[name], plain[name]) for name in plain)
    assert not (tmp_path / "plain" / PROFILE).exists()
    lines = (tmp_path / "profiled" / PROFILE).read_text().splitlines()
    assert lines[0].startswith("3 steps")
    stages = dict(row for line in lines[2 : lines.index("")] if (row := stage(line)))
    for name in ("encoder scoring", "encoder winners", "heads", "search", "z-buffer", "backward"):
        assert stages[name] > 0, name
    outer = ("sampling", "forward", "backward", "optimiser", "rest of the step")
    assert sum(stages[name] for name in outer) == pytest.approx(stages["step"], abs=0.01)


def stage(line):
    name, ms = line[:26].strip(), line[26:36]
    return name, float(ms)


def test_too_short_a_run_says_so(car_store, tmp_path):
    trained(car_store, tmp_path, 2, profile=True)
    assert "no step profiled" in (tmp_path / PROFILE).read_text()
