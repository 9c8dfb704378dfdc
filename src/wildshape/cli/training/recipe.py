# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `wildshape train` and `wildshape demo` share: the recipe for some data, and the bar."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.io.store.store import Store
    from wildshape.training.config import Recipe
    from wildshape.training.setup import Run


def recipe_for(store: "Store", preset: str, steps: int | None) -> "Recipe":
    """The preset, for the kind of sensor in the store, with another number of steps if asked.

    Raises:
        BadInputError: a preset of the paper that was made for the other kind of sensor; no steps.
    """
    from wildshape.training.recipes import PRESETS

    recipe = PRESETS[preset]()
    kind = store.sensor_of(0).kind
    if kind != recipe.views.sensor:
        if preset.startswith("paper-"):
            raise BadInputError(
                f"{store.path}: holds {kind} scans, but preset {preset} is for"
                f" {recipe.views.sensor} scans; choose another preset."
            )
        recipe = replace(recipe, views=replace(recipe.views, sensor=kind))
    if steps is None:
        return recipe
    if steps < 1:
        raise BadInputError(f"--steps {steps}: expected 1 or more.")
    return replace(recipe, optim=replace(recipe.optim, steps=steps))


def fit_with_progress(
    run: "Run", *, resume: str = "", adjust: "Callable[[Run], bool] | None" = None
) -> Path:
    """`fit` with a bar; a signal stops it between two steps and saves the state.

    Args:
        run: set up.
        resume: the command that goes on after a stop, for the message.
        adjust: called every 25 steps; may change the run's number of steps, and says whether.

    Raises:
        KeyboardInterrupt: stopped by a signal; its text says how to go on.
    """
    from wildshape.cli.interrupt import stop_flag
    from wildshape.cli.terminal import progress, say
    from wildshape.training.loop import StopRequested, fit

    first, silent = run.state.step, not run.processes.leads
    planned = None if adjust else run.recipe.optim.steps
    with (
        stop_flag() as stopped,
        progress("training", planned or 0, silent=silent, start=first) as bar,
    ):

        def report(step: int, values: dict[str, Any]) -> None:
            nonlocal planned
            if adjust is not None and adjust(run):
                planned = run.recipe.optim.steps
                say(f"training for {planned} steps, which fit into the time")
            bar.at(step, _line(values), total=planned)

        try:
            return fit(run, report, stopped)
        except StopRequested:
            raise stopped.error(
                f"stopped after step {run.state.step} of {run.recipe.optim.steps}, the state is"
                f" saved; go on with `{resume}`."
            ) from None


def _line(values: dict[str, Any]) -> str:
    shares = "/".join(f"{100 * share:.0f}" for share in values["branch_shares"])
    others = ("loss", "branch_shares", "steps_per_second")
    terms = ", ".join(f"{k} {value:.4f}" for k, value in values.items() if k not in others)
    return (
        f"loss {values['loss']:.4f} ({terms}), branches {shares} %,"
        f" {values['steps_per_second']:.1f} steps/s"
    )
