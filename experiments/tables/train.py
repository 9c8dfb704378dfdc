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

from wildshape.cli.models import choose_device
from wildshape.cli.terminal import progress, say
from wildshape.cli.train import fit_with_progress
from wildshape.io.atomic import write_json
from wildshape.io.provenance import provenance
from wildshape.io.store import open_store
from wildshape.training.loop import MODEL, setup

_TRAINED = "trained.json"


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
    teacher = row.teacher
    taught_by = model_of(shop, teacher, seed).path if isinstance(teacher, Trained) else teacher
    start = model_of(shop, row.start, seed).path if row.start else None
    made = provenance(shop.command)
    store = open_store(shop.data(row))
    say(f"{row.name}, seed {seed}")
    began = time.monotonic()
    with progress("fusing tracks", 0, silent=not isinstance(teacher, Trained)) as bar:
        run = setup(
            row.recipe,
            store,
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
    fit_with_progress(run, resume=shop.command)
    spent = {"steps": run.state.step, "from_step": first, "seconds": time.monotonic() - began}
    write_json(folder / _TRAINED, {**spent, "data": store.fingerprint, "provenance": made})
