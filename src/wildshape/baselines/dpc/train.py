# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape train --preset dpc...`: the learned baseline of the paper, on the same data."""

import os
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from wildshape.baselines.dpc.objective import PRESETS, DpcRecipe
from wildshape.baselines.dpc.run import DpcRun, fit_dpc, setup_dpc
from wildshape.errors import BadInputError
from wildshape.io.output import command_line, provenance
from wildshape.io.progress import SILENT, Progress
from wildshape.method.checkpoint import MODEL
from wildshape.ops.device import choose_device
from wildshape.training.config import stretched
from wildshape.training.loop import StopRequested
from wildshape.training.options import TrainingOptions
from wildshape.training.run_folder import begun_run, finish_run, open_training_data
from wildshape.training.train import Stopping, Trained, never_stopped


def train_dpc(
    data: Path,
    out: Path,
    options: TrainingOptions,
    progress: Progress = SILENT,
    stopping: Stopping = never_stopped,
) -> Trained:
    """Train, or go on training; see `training.train.train`.

    Raises:
        BadInputError: data that it cannot be trained on; an option that DPC has not; several
            processes.
        StopRequested: `stopping` said so, the state is saved; its text says how to go on.
    """
    _refuse_foreign(options)
    began, recipe = time.monotonic(), dpc_recipe(options)
    device = choose_device(options.device)
    with begun_run(data, out, options, only=recipe.views.sensor):
        run = setup_dpc(
            recipe,
            open_training_data(data, out, options, progress),
            out,
            seed=options.seed,
            device=device,
            resume=options.resume,
            provenance={**provenance(command_line()), "data": str(data)},
        )
    _fit(run, progress, stopping)
    finish_run(out)
    model = out / MODEL
    text = f"{run.recipe.name} is trained, {run.state.step} steps; the model is {model}"
    seconds = time.monotonic() - began
    return Trained(text, model, run.state.step, seconds, {}, asdict(run.recipe))


def _refuse_foreign(options: TrainingOptions) -> None:
    for option in ("encoder", "start", "teacher", "headings", "profile"):
        if getattr(options, option):
            raise BadInputError(f"--{option} is not for preset {options.preset}; drop it.")


def dpc_recipe(options: TrainingOptions) -> DpcRecipe:
    """The preset, with another number of steps if asked.

    Raises:
        BadInputError: several processes, or there is no preset of DPC of that name.
    """
    if int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise BadInputError(f"preset {options.preset} trains in one process; drop torchrun.")
    if options.preset not in PRESETS:
        raise BadInputError(
            f"--preset {options.preset}: is none of DPC; use one of {', '.join(PRESETS)}."
        )
    recipe = PRESETS[options.preset]
    if options.steps is None:
        return recipe
    return replace(recipe, optim=stretched(recipe.optim, options.steps))


def _fit(run: DpcRun, progress: Progress, stopping: Stopping) -> None:
    steps = run.recipe.optim.steps
    with stopping() as stopped, progress.bar("training DPC", steps, start=run.state.step) as bar:
        try:
            fit_dpc(run, lambda at, values: bar.at(at, _line(values)), stopped)
        except StopRequested:
            raise StopRequested(
                f"stopped after step {run.state.step} of {steps}, the state is saved; go on with"
                " the same command and --resume."
            ) from None


def _line(values: dict[str, Any]) -> str:
    shares = "/".join(f"{100 * share:.0f}" for share in values["branch_shares"])
    return (
        f"silhouette {values['silhouette']:.1f}, depth {values['depth']:.1f}, student"
        f" {values['student']:.3f}, candidates {shares} %,"
        f" {values['steps_per_second']:.1f} steps/s"
    )
