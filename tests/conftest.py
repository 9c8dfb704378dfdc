# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One thread a test process, the same examples on every run, and a few simulated cars."""

import pytest
import tests.runtime_types  # noqa: F401  before wildshape is imported
import torch
from hypothesis import settings
from tests.packed import packed

from wildshape.parallel import processes
from wildshape.parallel.handout import Handout
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("repeatable")
torch.set_num_threads(1)


@pytest.fixture(scope="session")
def cars():
    """Eight simulated drive-bys, 12 scans each."""
    config = SimulationConfig(tracks=8, scans=12, occlusion=0.0, shape_points=1024)
    return list(simulate_tracks(config, seed=1, workers=1))


@pytest.fixture(scope="session")
def car_store(cars, tmp_path_factory):
    """The same cars as a packed store."""
    path = tmp_path_factory.mktemp("cars") / "store"
    return packed(path, cars)


@pytest.fixture
def only_helpers(monkeypatch):
    """Other processes do all the work, however short it is; this one waits for them."""

    def wait(handout, task):
        with handout._change:
            come = handout._change.wait_for(
                lambda: handout._ready() is not None or handout.is_done(), timeout=120
            )
        assert come, "no helper came"

    monkeypatch.setattr(processes, "_WORTH_S", 0.0)
    monkeypatch.setattr(Handout, "do_one", wait)
