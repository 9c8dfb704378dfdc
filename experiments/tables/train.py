# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rows trained: once a seed, gone on with where stopped, found again when finished."""

import json
import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.tables.data import store_of
from experiments.tables.table import Trained

from wildshape.baselines.dpc.objective import DpcRecipe
from wildshape.baselines.dpc.run import fit_dpc, setup_dpc
from wildshape.cli.terminal import TERMINAL, say, stop_flag, stoppable
from wildshape.io.atomic import write_json
from wildshape.io.output import provenance
from wildshape.io.progress import SILENT
from wildshape.io.store.store import Store, open_store
from wildshape.ops.device import choose_device
from wildshape.training.config import Recipe
from wildshape.training.loop import MODEL, StopRequested, setup
from wildshape.training.train import fit_with_progress

_TRAINED = "trained.json"
Made = dict[str, Any]
Steps = tuple[int, int]  # done before, and now


@dataclass(frozen=True)
class Workshop:
    """Where everything is kept, and what it is made with.

    Attributes:
        folder: of data, runs and scores, shared by all tables.
        device: cpu, cuda or auto.
        command: that makes the table, as a user would type it.
    """

    folder: Path
    device: str
    command: str

    def data(self, row: Trained) -> Path:
        """The store that a row is trained on."""
        return store_of(self.folder, row.data)


@dataclass(frozen=True)
class Model:
    """A finished training: its checkpoint, and what is known of it."""

    path: Path
    made: dict[str, Any]


def model_of(shop: Workshop, row: Trained, seed: int) -> Model:
    """The checkpoint of a row under a seed, trained if it is not there."""
    slug = re.sub(r"[^a-z0-9]+", "-", row.recipe.name.lower()).strip("-")
    folder = shop.folder / "runs" / f"{slug}-{row.key}" / f"seed{seed}"
    record = folder / _TRAINED
    if not record.is_file():
        _train(shop, row, seed, folder)
    return Model(folder / MODEL, json.loads(record.read_text("utf-8")))


def _train(shop: Workshop, row: Trained, seed: int, folder: Path) -> None:
    """Train, and say at the end what it cost."""
    store = open_store(shop.data(row))
    made = provenance(shop.command)
    say(f"{row.name}, seed {seed}")
    began, worked = time.monotonic(), time.process_time()
    if isinstance(row.recipe, DpcRecipe):
        first, steps = _train_dpc(shop, row.recipe, store, seed, folder, made)
    else:
        first, steps = _train_ours(shop, row, row.recipe, seed, folder, made)
    spent = {
        "steps": steps,
        "from_step": first,
        "seconds": round(time.monotonic() - began, 2),
        "processor_seconds": round(time.process_time() - worked, 2),
    }
    write_json(folder / _TRAINED, {**spent, "data": store.fingerprint, "provenance": made})


def _train_ours(
    shop: Workshop, row: Trained, recipe: Recipe, seed: int, folder: Path, made: Made
) -> Steps:
    teacher = row.teacher
    taught_by = model_of(shop, teacher, seed).path if isinstance(teacher, Trained) else teacher
    start = model_of(shop, row.start, seed).path if row.start else None
    shown = TERMINAL if isinstance(teacher, Trained) else SILENT
    with shown.bar("fusing tracks", 0) as bar:
        run = setup(
            recipe,
            open_store(shop.data(row)),
            folder,
            seed=seed,
            device=choose_device(shop.device),
            resume=True,
            start=start,
            teacher=taught_by,
            provenance=made,
            taught=lambda done, total: bar.at(done, total=total),
            say=say,
        )
    first = run.state.step
    fit_with_progress(run, TERMINAL, stoppable, resume=shop.command)
    return first, run.state.step


def _train_dpc(
    shop: Workshop, recipe: DpcRecipe, store: Store, seed: int, folder: Path, made: Made
) -> Steps:
    device = choose_device(shop.device)
    run = setup_dpc(recipe, store, folder, seed=seed, device=device, resume=True, provenance=made)
    first, steps = run.state.step, recipe.optim.steps
    with stop_flag() as stopped, TERMINAL.bar("training DPC", steps, start=first) as bar:
        try:
            fit_dpc(run, lambda at, _: bar.at(at), stopped)
        except StopRequested:
            text = f"stopped after step {run.state.step}; go on with `{shop.command}`"
            raise stopped.error(text) from None
    return first, run.state.step
