# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The GPU's step without a GPU: its kernels interpreted, and no tensor left on the host."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.training.steps import RECIPES, step_of, take
from torch.utils._python_dispatch import TorchDispatchMode

from wildshape.geometry.projection.line_of_sight import Facing
from wildshape.method import hindsight
from wildshape.method.network import ShapePoseNet
from wildshape.ops.nearest.neighbours import Neighbours
from wildshape.training.batches.fused import FusedSampler
from wildshape.training.batches.resident import ResidentViews, _Scans
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training import objective as taught
from wildshape.training.self_training.targets import true_targets

ROOT = Path(__file__).parents[2]
COPIES = (torch.ops.aten._to_copy, torch.ops.aten.copy_)
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


class HostCopies(TorchDispatchMode):
    """Counts copies of the host's tensors to another device, which a CUDA graph refuses."""

    def __init__(self):
        super().__init__()
        self.count = 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        result = func(*args, **(kwargs or {}))
        if func.overloadpacket in COPIES:
            source = args[1] if func.overloadpacket is torch.ops.aten.copy_ else args[0]
            self.count += source.device.type == "cpu" != result.device.type
        return result


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
    with HostCopies() as copies:
        result = step.objective(step.views.batch(number))
        result.loss.backward()
    assert copies.count == 0
    torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    step.meter.write(number, result)
    parts = (result.loss, result.winner, *result.terms.values(), step.meter.ring)
    assert all(part.device.type == "meta" for part in parts)
    assert all(p.grad is not None and p.grad.device.type == "meta" for p in network.parameters())
    with pytest.raises(RuntimeError):
        take(step, recipe, 1)  # dials and optimiser are on the host: the mixture is seen


@pytest.mark.parametrize("complete", [False, True])
def test_a_taught_step_copies_nothing_from_the_host(car_store, monkeypatch, complete):
    monkeypatch.setattr(taught, "nearest_both", no_neighbours)
    monkeypatch.setattr(taught, "visible", lambda bins, *_: torch.empty_like(bins).bool())
    recipe = RECIPES[2]
    sampler = ViewSampler(car_store, np.arange(8), recipe.views)
    targets = true_targets(sampler)._replace(complete=complete)
    batch = FusedSampler(sampler, targets, mirror=True).draw(0).to("meta")
    network = ShapePoseNet(recipe.network).to("meta")
    objective = taught.SelfTaught(network, complete, "static", unit=0.5)
    with HostCopies() as copies:
        objective(batch).loss.backward()
    assert copies.count == 0
    with copies:
        torch.zeros(1).to("meta")
    assert copies.count == 1
