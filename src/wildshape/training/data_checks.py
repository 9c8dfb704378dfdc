# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What should be said of data before hours are spent on them."""

import numpy as np

from wildshape.datasets.tracks.truth import misplaced
from wildshape.geometry.box import extent
from wildshape.geometry.projection.line_of_sight import surrounded
from wildshape.io.store.store import Store
from wildshape.records import Points
from wildshape.training.config import Recipe
from wildshape.training.recipes import PRESETS, recipe_named

_SAMPLE, _MOST = 200, 0.5
_USUAL_M = {"lidar": (1.0, 25.0), "camera": (0.4, 2.5)}
"""Diagonals of what presets are for: vehicles; objects of unit size, or chairs in metres."""


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
    elif few := store.scan_count - int(usable.sum()):
        without = int((usable == 0).sum())
        doubts.append(
            f"{store.named}: {few:,} of {store.scan_count:,} scans have fewer than {least} points"
            f" and are not trained on; {without:,} of {len(store):,} tracks have no others"
        )
    seen = _sample_of(store)
    if np.mean([surrounded(scan) for scan in seen]) > _MOST:
        doubts.append(
            f"{store.named}: the origin lies within most scans, where no sensor can have stood, and"
            " a model may learn little; leave scans in their sensors' frames, uncentred"
        )
    return doubts if made_for != kind else doubts + _doubts_of_size(store, recipe, seen)


def doubts_of_truth(store: Store) -> list[str]:
    """Where the first track's true poses do not put its scans onto its shape."""
    first = store.track(0)
    odd = "" if first.T_sensor_object is None else misplaced(first)
    cure = (
        "check unit, frame and direction of the poses: figures validation/truth_... rest on them,"
        " and all that an oracle learns"
    )
    return [f"{store.named}: {first.name}: {odd}; {cure}"] if odd else []


def _sample_of(store: Store) -> list[Points]:
    rows = np.random.default_rng(0).permutation(store.scan_count)[:_SAMPLE]
    scans = (store.scan_points(int(row)) for row in rows)
    return [scan for scan in scans if len(scan)]


def _doubts_of_size(store: Store, recipe: Recipe, seen: list[Points]) -> list[str]:
    """Where scans are far from the size of object that the preset's lengths were chosen for."""
    size = float(np.median([extent(scan) for scan in seen]))
    low, high = _USUAL_M[recipe_named(recipe.name).views.sensor]
    if low <= size <= high:
        return []
    return [
        f"{store.named}: scans are {size:.3g} m across (median), but preset {recipe.name} has the"
        f" lengths for objects of {low:g} to {high:g} m and may learn little; scale the"
        " coordinates, or give their --unit"
    ]
