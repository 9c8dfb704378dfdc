# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The GPU's step without a GPU: its kernels interpreted, and no tensor left on the host."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import torch
from tests.training.steps import RECIPES, step_of, take

from wildshape.geometry.projection.line_of_sight import Facing
from wildshape.method import hindsight
from wildshape.ops.nearest.neighbours import Neighbours
from wildshape.training.batches.resident import ResidentViews, _Scans

ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys
import torch
from tests.training.steps import RECIPES, step_of, take
from wildshape.io.store.store import open_store
from wildshape.method import hindsight
from wildshape.ops import nearest
from wildshape.ops.zbuffer.zbuffer_triton import visible_triton

store = open_store(sys.argv[1])
for recipe, encoding, off in ((RECIPES[0], "bf16", 2e-2), (RECIPES[2], "static", 1e-4)):
    expected = take(step_of(recipe, store), recipe, 2)
    kept = nearest.backend, hindsight.visible
    nearest.backend = lambda device="cpu": "triton"
    hindsight.visible = visible_triton
    found = take(step_of(recipe, store, encoding), recipe, 2)
    nearest.backend, hindsight.visible = kept
    torch.testing.assert_close(found, expected, rtol=off, atol=0)
"""


@pytest.mark.skipif(not find_spec("triton"), reason="triton is not installed")
def test_steps_with_the_gpus_kernels_are_the_same_steps(car_store):
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(car_store.path)],
        cwd=ROOT,
        env=os.environ | {"TRITON_INTERPRET": "1", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert result.returncode == 0, result.stderr[-3000:]


def elsewhere(value):
    """The same record with its tensors on the meta device, which computes shapes alone."""
    if isinstance(value, Facing | _Scans):
        return type(value)(*(elsewhere(part) for part in value))
    return value.to("meta")


def no_neighbours(a, b, own=None):
    """What the search would return, without values."""
    both = (a, b), (b, a)
    found = [(x.new_empty(x.shape[:2]), x.new_empty(x.shape[:2]).long()) for x, _ in both]
    return tuple(Neighbours(*pair) for pair in found)


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_no_tensor_of_a_step_is_left_on_the_host(car_store, recipe, monkeypatch):
    """On another device any operation that mixes the two raises, and so does reading a value."""
    monkeypatch.setattr(hindsight, "nearest_both", no_neighbours)
    monkeypatch.setattr(hindsight, "visible", lambda bins, *_: torch.empty_like(bins).bool())
    step = step_of(recipe, car_store)
    assert isinstance(step.views, ResidentViews)
    network = step.state.network.to("meta")
    step.views._scans = elsewhere(step.views._scans)
    step.views._anchors = elsewhere(step.views._anchors)
    number = torch.zeros((), dtype=torch.int64, device="meta")
    result = step.objective(step.views.batch(number))
    result.loss.backward()
    torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    step.meter.write(number, result)
    parts = (result.loss, result.winner, *result.terms.values(), step.meter.ring)
    assert all(part.device.type == "meta" for part in parts)
    assert all(p.grad is not None and p.grad.device.type == "meta" for p in network.parameters())
    with pytest.raises(RuntimeError):
        take(step, recipe, 1)  # dials and optimiser are on the host: the mixture is seen
