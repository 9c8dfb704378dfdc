# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A whole training from an input to a checkpoint: what `wildshape train` does.

`loop.fit` trains what `setup` has made; here data, options and preset come together.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from wildshape.arguments import as_path, expect
from wildshape.errors import BadInputError
from wildshape.io.output import provenance
from wildshape.io.progress import SILENT, Progress, counted, duration
from wildshape.io.store.store import Store
from wildshape.method.checkpoint import MODEL, load_checkpoint, weights_file
from wildshape.ops.device import choose_device
from wildshape.training.config import Recipe
from wildshape.training.data_checks import doubts_of, doubts_of_truth
from wildshape.training.loop import Run, StopRequested, fit, setup
from wildshape.training.options import TrainingOptions
from wildshape.training.recipes import (
    only_sensor,
    recipe_for,
    recipe_named,
    with_encoder,
    with_rays,
)
from wildshape.training.run_folder import begun_run, finish_run, open_training_data
from wildshape.training.runtime.profiler import PROFILE
from wildshape.training.runtime.torchrun import launched
from wildshape.training.setup import new_network

Stopping = Callable[[], AbstractContextManager[Callable[[], bool]]]
"""Gives a context in which a training asks between two steps whether to stop."""


def never_stopped() -> AbstractContextManager[Callable[[], bool]]:
    """Nobody asks to stop."""
    return nullcontext(lambda: False)


@dataclass(frozen=True)
class Trained:
    """What came of a training.

    Attributes:
        sentence: in words.
        model: the checkpoint.
        steps: gradient steps in all.
        seconds: of this run.
        metrics: of the validation.
        recipe: as trained, JSON values.
        leads: false in a process that does not lead others; it says nothing.
    """

    sentence: str
    model: Path
    steps: int
    seconds: float
    metrics: dict[str, Any]
    recipe: dict[str, Any]
    leads: bool = True

    @property
    def data(self) -> dict[str, Any]:
        """The same as JSON values."""
        return {
            "model": str(self.model),
            "steps": self.steps,
            "seconds": round(self.seconds, 3),
            "metrics": self.metrics,
            "recipe": self.recipe,
        }


_DEFAULT = TrainingOptions()


def train(
    data: Path | str,
    out: Path | str,
    options: TrainingOptions = _DEFAULT,
    progress: Progress = SILENT,
    stopping: Stopping = never_stopped,
) -> Trained:
    """Train, or go on training.

    Args:
        data: a packed store, or a DATASET folder.
        out: folder of the run.
        options: how.
        progress: is told what goes on.
        stopping: a context of the training alone; what it gives is asked between two steps.

    Raises:
        BadInputError: data or options that cannot be used, an existing run without `resume`.
        StopRequested: `stopping` said so, the state is saved; its text says how to go on.
    """
    data, out = as_path(data, "data"), as_path(out, "out")
    expect(options, TrainingOptions, "options")
    device, weights = choose_device(options.device), _Weights.named_in(options)
    weights.refuse_misfits(options)
    only = only_sensor(recipe_named(options.preset))
    with begun_run(data, out, options, weights.files, only), _resumable(options):
        store = open_training_data(data, out, options, progress)
        recipe = weights.suited(recipe_for(store, options.preset, options.steps), options)
        run = _set_up(recipe, store, data, out, options, weights, device, progress)
    if options.profile and run.processes.leads:
        run.profile = out / PROFILE
    began, first = time.monotonic(), run.state.step
    if first >= recipe.optim.steps and (out / MODEL).is_file():
        return _finished(run, out, 0.0, f"{out} was finished already")
    fit_with_progress(run, progress, stopping, resume=_resuming(options))
    seconds = time.monotonic() - began
    text = f"trained {counted(run.state.step - first, 'step')} in {duration(seconds)}"
    return _finished(run, out, seconds, text)


def _resuming(options: TrainingOptions) -> str:
    """The command that goes on with a run."""
    return launched() if options.resume else f"{launched()} --resume"


@contextmanager
def _resumable(options: TrainingOptions) -> Iterator[None]:
    """A stop before the first step says how to go on: tracks may have been fused for an hour."""
    try:
        yield
    except KeyboardInterrupt as stopped:
        sentence = f"stopped before training; go on with `{_resuming(options)}`."
        raise type(stopped)(sentence) from None


class _Weights(NamedTuple):
    """The checkpoints that a user names, found before anything is written."""

    start: Path | None
    teacher: Path | Literal["truth"] | None
    headings: Path | None

    @classmethod
    def named_in(cls, options: TrainingOptions) -> "_Weights":
        """Of the options.

        Raises:
            BadInputError: a checkpoint that is not there.
        """
        truth = options.teacher == "truth"
        teacher = "truth" if truth else _checkpoint("teacher", options.teacher)
        start, headings = options.start, options.headings
        return cls(_checkpoint("start", start), teacher, _checkpoint("headings", headings))

    @property
    def files(self) -> list[Path]:
        """Those that are named."""
        return [named for named in self if isinstance(named, Path)]

    def suited(self, recipe: Recipe, options: TrainingOptions) -> Recipe:
        """The recipe with the encoder asked for, and rays where the weights to start from do."""
        recipe = with_encoder(recipe, options.encoder or recipe.network.backbone)
        if self.start is None:
            return recipe
        return with_rays(recipe, load_checkpoint(self.start)[1].network.rays)

    def refuse_misfits(self, options: TrainingOptions) -> None:
        """Look into the files before an earlier run is replaced, and tracks are packed.

        Raises:
            BadInputError: no checkpoint of ours, or to start from one of another preset.
        """
        for file in self.files:
            load_checkpoint(file)
        new_network(self.suited(recipe_named(options.preset), options), self.start)


def _set_up(
    recipe: Recipe,
    store: Store,
    data: Path,
    out: Path,
    options: TrainingOptions,
    weights: _Weights,
    device: str,
    progress: Progress,
) -> Run:
    learns = isinstance(weights.teacher, Path)
    leads = int(os.environ.get("RANK", "0")) == 0
    for doubt in (*doubts_of(store, recipe), *doubts_of_truth(store)) if leads else ():
        progress.say(doubt)
    with (progress if learns and leads else SILENT).bar("fusing tracks", 0) as bar:
        return setup(
            recipe,
            store,
            out,
            seed=options.seed,
            device=device,
            resume=options.resume,
            start=weights.start,
            teacher=weights.teacher,
            headings=weights.headings,
            provenance={**provenance(launched()), "data": str(data)},
            taught=lambda done, total: bar.at(done, total=total),
            say=progress.say,
        )


def _checkpoint(option: str, model: str | None) -> Path | None:
    """The checkpoint that a user names."""
    if model is None:
        return None
    file = weights_file(None if model == "shipped" else Path(model))
    if not file.is_file():
        raise BadInputError(
            f"--{option} {model}: {file} is not there; name a .safetensors file, or a run that has"
            " written its model."
        )
    return file


def fit_with_progress(
    run: Run,
    progress: Progress = SILENT,
    stopping: Stopping = never_stopped,
    *,
    resume: str = "",
    adjust: Callable[[Run], bool] | None = None,
) -> Path:
    """`fit` with a bar; `stopping` ends it between two steps and saves the state.

    Args:
        run: set up.
        progress: is told what goes on, if this process leads.
        stopping: a context of the training alone; what it gives is asked between two steps.
        resume: the command that goes on after a stop, for the message.
        adjust: called every 25 steps; may change the run's number of steps, and says whether.

    Raises:
        StopRequested: its text says how to go on.
    """
    planned = None if adjust else run.recipe.optim.steps
    shown = progress if run.processes.leads else SILENT
    with stopping() as stopped, shown.bar("training", planned or 0, start=run.state.step) as bar:

        def report(step: int, values: dict[str, Any]) -> None:
            nonlocal planned
            if adjust is not None and adjust(run):
                planned = run.recipe.optim.steps
                progress.say(f"training for {planned} steps, which fit into the time")
            bar.at(step, _line(values), total=planned)

        try:
            return fit(run, report, stopped)
        except StopRequested:
            raise StopRequested(
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


def _finished(run: Run, out: Path, seconds: float, text: str) -> Trained:
    model, recipe, leads = out / MODEL, asdict(run.recipe), run.processes.leads
    metrics: dict[str, Any] = {}
    if leads:
        finish_run(out)
        metrics = load_checkpoint(model)[1].metrics
    sentence = f"{text}; the model is {model}"
    return Trained(sentence, model, run.state.step, seconds, metrics, recipe, leads)
