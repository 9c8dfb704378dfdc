# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training steps as on a GPU, of recipes in small."""

import copy
from dataclasses import replace

import numpy as np
import torch

from wildshape.method.network import Encoding, ShapePoseNet
from wildshape.training.batches.resident import ResidentViews
from wildshape.training.batches.views import ViewSampler
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.recipes import default, paper_lidar, paper_views
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.state import TrainState
from wildshape.training.step import Step

CPU = torch.device("cpu")

SEED = 3


def in_small(recipe):
    """The recipe with the sizes of the smallest, its losses and rules as they are."""
    network = replace(
        recipe.network, encoder=(16, 16, 32, 32), decoder=(32, 32), pose=(16, 16), points=64
    )
    return replace(
        recipe, network=network, views=replace(recipe.views, tracks=2, views=2, points=48)
    )


RECIPES = [in_small(r) for r in (paper_lidar(), paper_views(), default())]


def step_of(recipe, store, encoding: Encoding = "static"):
    """A step whose scans are resident, its encoder of fixed shapes."""
    torch.manual_seed(SEED)
    network = ShapePoseNet(recipe.network)
    rate = torch.tensor(recipe.optim.lr)
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True)
    state = TrainState(network, copy.deepcopy(network), optimiser)
    sampler = ViewSampler(store, np.arange(len(store)), recipe.views)
    views = ResidentViews(sampler, SEED, 0, CPU)
    objective = WeaklySupervised(network, recipe.loss, encoding)
    meter = Meter(recipe.network.branches, 0, CPU)
    return Step(state, objective, views, meter, recipe.optim.clip)


def take(step, recipe, count, first=0):
    for number in range(first, first + count):
        step.prepare(number, recipe)
        step.advance()
    return step.meter.losses(first, first + count)
