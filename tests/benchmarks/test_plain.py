# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The step that the benchmarks call plain is the step that we train with."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from benchmarks.plain import gradients_as_ours, plain_loss, twin_of  # pyright: ignore

from wildshape.geometry.projection.visibility import PolarBins
from wildshape.method.network import ShapePoseNet
from wildshape.training.batches.views import ViewSampler
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.recipes import tiny


@pytest.mark.parametrize("ours_beyond_the_paper", [True, False])
def test_same_loss_and_gradients(car_store, ours_beyond_the_paper):
    recipe = tiny()
    network, loss = recipe.network, recipe.loss
    if not ours_beyond_the_paper:
        network = replace(network, mirror=False, selector=False)
        loss = replace(loss, projection=PolarBins(), belief=0.0, time_ordered=False)
    batch = ViewSampler(car_store, np.arange(len(car_store)), recipe.views).draw(0, 0)
    torch.manual_seed(0)
    ours = ShapePoseNet(network)
    plain = twin_of(ours)
    expected = plain_loss(plain, batch, loss, exact=True)
    found = WeaklySupervised(ours, loss)(batch).loss
    expected.backward()
    found.backward()
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=0)
    theirs = gradients_as_ours(plain, ours)
    for name, parameter in ours.named_parameters():
        assert parameter.grad is not None, name
        apart = (parameter.grad - theirs[name]).norm() / theirs[name].norm()
        assert apart < 2e-3, name  # float32: a maximum that ties to rounding may take either way
