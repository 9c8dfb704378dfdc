# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What should be said of data before hours are spent on them."""

import numpy as np

from wildshape.io.store.store import Store
from wildshape.training.config import Recipe
from wildshape.training.recipes import PRESETS, recipe_named


def doubts_of(store: Store, recipe: Recipe) -> list[str]:
    """A sentence each on why a preset may learn nothing from a store; empty as a rule.

    Args:
        store: the tracks.
        recipe: a preset, for the store's kind of sensor (`recipes.recipe_for`).
    """
    doubts = []
    made_for, kind = recipe_named(recipe.name).views.sensor, recipe.views.sensor
    if made_for != kind:
        others = ", ".join(n for n, preset in PRESETS.items() if preset().views.sensor == kind)
        doubts.append(
            f"{store.named}: holds {kind} scans, but preset {recipe.name} has the numbers for"
            f" {made_for} scans and may learn little; presets for these are {others}"
        )
    least = recipe.views.min_points
    usable = np.add.reduceat((store.scan_sizes >= least).astype(int), store.track_starts[:-1])
    if usable.max() < 2:
        doubts.append(
            f"{store.named}: no track has two scans of {least} points or more, but shapes and poses"
            " are learned from several scans of one object; expect a model that knows neither"
        )
    return doubts
