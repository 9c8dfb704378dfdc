# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The model trained on what it found, by the library's own self-training.

Targets are fused from whole tracks. Each looks where the first pass says that its vehicle looks:
left to themselves, near-symmetric vehicles turn around.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.examples import Example
from wildshape.drives.clock import Watch
from wildshape.inference.predictor import Predictor
from wildshape.io.output import command_line, provenance
from wildshape.io.store.store import Store, is_finished_store, open_store
from wildshape.io.write_tracks import write_tracks
from wildshape.method.checkpoint import MODEL, ModelSettings, load_checkpoint, save_checkpoint
from wildshape.training.config import OptimConfig, Recipe, ValidationConfig
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import default

_BASE, _STORE, _RUN = "base.safetensors", "tracks.store", "run"


def taught(
    base: Predictor, examples: Sequence[Example], folder: Path, config: AdaptConfig, told: Watch
) -> Path:
    """A checkpoint trained on the examples; an interrupted run is gone on with.

    Args:
        base: where it begins, and its teacher.
        examples: tracks to train on.
        folder: to work in.
        config: see there.
        told: of its stages.

    Raises:
        BadInputError: what an earlier run left is damaged.
    """
    start = folder / _BASE
    if not start.is_file():
        save_checkpoint(start, base.network, base.settings)
    run = setup(
        recipe_of(base.settings, config),
        _packed(examples, folder / _STORE, config),
        folder / _RUN,
        seed=config.seed,
        device=base.device.type,
        resume=True,
        start=start,
        teacher=start,
        fronts=torch.from_numpy(np.concatenate([one.fronts for one in examples])),
        provenance=provenance(command_line()),
        taught=lambda done, total: told("fusing", done, total),
    )
    told("training", run.state.step, config.steps)
    fit(run, lambda step, _: told("training", step, config.steps))
    return _with_settings_of(base.settings, folder)


def recipe_of(settings: ModelSettings, config: AdaptConfig) -> Recipe:
    """A short training of a model that is trained already, of its own sizes."""
    base = default()
    return replace(
        base,
        name="adapt",
        network=settings.network,
        loss=replace(
            base.loss, projection=settings.projection, beta=settings.beta, belief=settings.belief
        ),
        views=replace(
            base.views,
            points=settings.input_points,
            turn="facing" if settings.facing else "none",
            min_points=config.fewest_points,
        ),
        optim=OptimConfig(
            steps=config.steps,
            lr=config.lr,
            decay_every=0,
            warmup=20,
            average=config.average,
            clip=5.0,
            search=base.optim.search,
        ),
        validate_every=config.save_every,
        validation=ValidationConfig(batches=1),
        held_out=sys.maxsize,  # none of these: tracks are held out already
    )


def _packed(examples: Sequence[Example], path: Path, config: AdaptConfig) -> Store:
    if not is_finished_store(path):
        settings = {"scans": config.scans, "seed": config.seed}
        tracks = (one.track for one in examples)
        write_tracks(tracks, path, "packed", command="drive --adapt", settings=settings)
    return open_store(path)


def _with_settings_of(base: ModelSettings, folder: Path) -> Path:
    """The run's weights with what is known of the model they come from: how sure it is, say.

    Its calibration was measured against truth, which is not here; the objects that it knows are
    more now.
    """
    network, trained = load_checkpoint(folder / _RUN / MODEL)
    (low, high), (least, most) = base.extent_m, trained.extent_m
    settings = replace(
        base,
        extent_m=(min(low, least), max(high, most)),
        provenance=trained.provenance,
        metrics=trained.metrics,
    )
    path = folder / _RUN / "candidate.safetensors"
    save_checkpoint(path, network, settings)
    return path
