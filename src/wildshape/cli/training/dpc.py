# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape train --preset dpc...`: the learned baseline of the paper, on the same data."""

import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.baselines.dpc.objective import DpcRecipe
    from wildshape.baselines.dpc.training import DpcRun
    from wildshape.cli.output import Output
    from wildshape.io.store.store import Store


@dataclass(frozen=True)
class DpcOrder:
    """The options of `train` that DPC has too; see there."""

    preset: str
    steps: int | None
    seed: int
    data: Path
    out: Path
    resume: bool
    json: bool
    device: str

    @classmethod
    def of(cls, settings: dict[str, Any], device: str) -> "DpcOrder":
        """From the settings of `train` by name.

        Raises:
            BadInputError: an option is set that DPC has not.
        """
        for option in ("encoder", "start", "teacher", "headings", "profile"):
            if settings[option]:
                raise BadInputError(f"--{option} is not for preset {settings['preset']}; drop it.")
        own = ("preset", "steps", "seed", "data", "out", "resume", "json")
        return cls(**{name: settings[name] for name in own}, device=device)


def train_dpc(order: DpcOrder, output: "Output | None", open_data: "Callable[[], Store]") -> None:
    """Train, or go on training.

    Args:
        order: what is asked for.
        output: marker of a new run.
        open_data: gives the tracks.

    Raises:
        BadInputError: data that it cannot be trained on; no steps; several processes.
        KeyboardInterrupt: stopped by a signal, the state saved.
    """
    try:
        run = _prepared(order, open_data)
    except BadInputError:
        if output is not None:
            output.abandon()
        raise
    _train(run)
    _conclude(order, run)


def _prepared(order: DpcOrder, open_data: "Callable[[], Store]") -> "DpcRun":
    from wildshape.baselines.dpc.training import setup_dpc
    from wildshape.cli.output import command_line
    from wildshape.io.provenance import provenance

    return setup_dpc(
        dpc_recipe(order),
        open_data(),
        order.out,
        seed=order.seed,
        device=order.device,
        resume=order.resume,
        provenance={**provenance(command_line()), "data": str(order.data)},
    )


def dpc_recipe(order: DpcOrder) -> "DpcRecipe":
    """The preset, with another number of steps if asked.

    Raises:
        BadInputError: no steps, or several processes.
    """
    from wildshape.baselines.dpc.objective import PRESETS

    if int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise BadInputError(f"preset {order.preset} trains in one process; drop torchrun.")
    recipe = PRESETS[order.preset]
    if order.steps is None:
        return recipe
    if order.steps < 1:
        raise BadInputError(f"--steps {order.steps}: expected 1 or more.")
    return replace(recipe, optim=replace(recipe.optim, steps=order.steps))


def _train(run: "DpcRun") -> None:
    """With a bar; a signal stops between two steps."""
    from wildshape.baselines.dpc.training import fit_dpc
    from wildshape.cli.interrupt import stop_flag
    from wildshape.cli.terminal import progress

    steps = run.recipe.optim.steps
    with stop_flag() as stopped, progress("training DPC", steps, start=run.state.step) as bar:
        if not fit_dpc(run, lambda at, values: bar.at(at, _line(values)), stopped):
            raise stopped.error(
                f"stopped after step {run.state.step} of {steps}, the state is saved; go on with"
                " the same command and --resume."
            )


def _line(values: dict[str, Any]) -> str:
    shares = "/".join(f"{100 * share:.0f}" for share in values["branch_shares"])
    return (
        f"silhouette {values['silhouette']:.1f}, depth {values['depth']:.1f}, student"
        f" {values['student']:.3f}, candidates {shares} %,"
        f" {values['steps_per_second']:.1f} steps/s"
    )


def _conclude(order: DpcOrder, run: "DpcRun") -> None:
    from wildshape.cli.output import MARKER
    from wildshape.cli.terminal import answer
    from wildshape.io.atomic import write_json
    from wildshape.training.loop import MODEL

    marker, model = order.out / MARKER, order.out / MODEL
    write_json(marker, {**json.loads(marker.read_text("utf-8")), "status": "finished"})
    data = {"model": str(model), "steps": run.state.step, "recipe": asdict(run.recipe)}
    text = f"{run.recipe.name} is trained, {run.state.step} steps; the model is {model}"
    answer(text, data, as_json=order.json)
