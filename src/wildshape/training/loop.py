# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training: set up, fit, validate, save. One loop for a CPU, a GPU and several processes."""

import copy
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.profiler import record_function

from wildshape.datasets.views import ViewSampler
from wildshape.errors import BadInputError
from wildshape.io.store import Store
from wildshape.models.checkpoint import ModelSettings, load_checkpoint, save_checkpoint
from wildshape.models.shapepose import ShapePoseNet
from wildshape.ops.allocator import keep_memory
from wildshape.training.config import Recipe
from wildshape.training.headings import agree_on_headings
from wildshape.training.log import RunLog
from wildshape.training.objectives import Objective, WeaklySupervised
from wildshape.training.processes import Processes, join
from wildshape.training.profile import steps_profiled
from wildshape.training.schedule import learning_rate, template_weight
from wildshape.training.state import STATE, TrainState, load_state, save_state
from wildshape.training.validate import Validation, truth_figures, validate

MODEL = "model.safetensors"
_HELD_OUT, _VALIDATION_BATCHES, _LOG_EVERY = 20, 8, 25
Progress = Callable[[int, dict[str, Any]], None]


@dataclass
class Run:
    """All that a run needs, set up; `profile` is where to write where a step's time goes."""

    recipe: Recipe
    seed: int
    folder: Path
    processes: Processes
    state: TrainState
    sampler: ViewSampler
    held_out: ViewSampler
    held_tracks: np.ndarray
    identity: dict[str, str]
    provenance: dict[str, Any]
    profile: Path | None = None


class StopRequested(Exception):  # noqa: N818
    """Raised by a caller's progress function to stop after the current step."""


def setup(
    recipe: Recipe,
    store: Store,
    folder: Path,
    *,
    seed: int = 0,
    device: str = "cpu",
    resume: bool = False,
    start: Path | None = None,
    provenance: dict[str, Any] | None = None,
) -> Run:
    """Build the network, the optimiser and the samplers; load the state if resuming.

    Args:
        recipe: what to train and how.
        store: the tracks.
        folder: of the run, made if need be.
        seed: of weights and batches.
        device: cpu or cuda.
        resume: go on from the folder's state, if it has one.
        start: checkpoint whose weights are fine-tuned, instead of random ones.
        provenance: written into the run and its checkpoint.

    Raises:
        BadInputError: no usable scans; a state that belongs to another run; or a checkpoint of
            other sizes than the recipe's.
    """
    keep_memory()
    processes = join(device)
    torch.manual_seed(seed)
    network = _network(recipe, start).to(processes.device)
    fused = processes.device.type == "cuda"
    optimiser = torch.optim.Adam(network.parameters(), lr=recipe.optim.lr, fused=fused)
    state = TrainState(network, copy.deepcopy(network), optimiser)
    fit_tracks, held_tracks = split_tracks(len(store))
    identity = {
        "settings": _short_hash(repr(recipe).encode()),
        "data": store.fingerprint,
        "seed": str(seed),
        "processes": str(processes.count),
        "start": _short_hash(start.read_bytes()) if start else "",
    }
    folder.mkdir(parents=True, exist_ok=True)
    if resume and (folder / STATE).exists():
        load_state(folder, state, identity)
    sampler = ViewSampler(store, fit_tracks, recipe.views)
    held_out = ViewSampler(store, held_tracks, recipe.views)
    described = {"recipe": asdict(recipe), "identity": identity, **(provenance or {})}
    run = Run(
        recipe, seed, folder, processes, state, sampler, held_out, held_tracks, identity, described
    )
    if processes.leads:
        (folder / "run.json").write_text(json.dumps(described, indent=1, default=str))
    return run


def _network(recipe: Recipe, start: Path | None) -> ShapePoseNet:
    """A new network, or the checkpoint's."""
    if start is None:
        return ShapePoseNet(recipe.network)
    network, settings = load_checkpoint(start)
    if settings.network != recipe.network:
        raise BadInputError(
            f"{start}: its sizes are not those of the preset {recipe.name}: expected"
            f" {recipe.network}, found {settings.network}; choose the preset it was trained with."
        )
    return network.train()


def split_tracks(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Tracks to fit and tracks held out: one in 20, the same for every seed; all if few."""
    order = np.random.default_rng(0).permutation(count)
    held = count // _HELD_OUT if count >= _HELD_OUT else 0
    return (order[held:], order[:held]) if held else (order, order)


def fit(
    run: Run, progress: Progress | None = None, stopped: Callable[[], bool] = lambda: False
) -> Path:
    """Train to the last step, validating and saving on the way; returns the checkpoint's path.

    Args:
        run: set up.
        progress: called every 25 steps with the step and the means since the last call.
        stopped: asked after every step; with several processes, every 25 steps.

    Raises:
        StopRequested: `stopped` said so; the state is saved.
        BadInputError: the loss is not finite; the last checkpoint stays.
    """
    objective = run.processes.wrap(WeaklySupervised(run.state.network, run.recipe.loss))
    meter = Meter(run.recipe.network.branches)
    with (
        RunLog(run.folder, run.state.step) if run.processes.leads else _Silent() as log,
        steps_profiled(run.profile) as step_done,
    ):
        while run.state.step < run.recipe.optim.steps:
            meter.add(_step(run, objective))
            step_done()
            step, steps = run.state.step, run.recipe.optim.steps
            due = step < steps and step % run.recipe.validate_every == 0
            stop = step < steps and _stop_asked(run, stopped)
            # Whatever is saved below, its loss is read before and refused if not finite.
            if due or stop or step % _LOG_EVERY == 0 or step == steps:
                values = meter.read(step)
                log.write(step, values)
                if progress is not None:
                    _report(run, progress, values)
            if stop:
                _save_and_stop(run)
            if due:
                log.write(step, checkpoint(run))
        log.write(run.state.step, checkpoint(run))
    run.processes.leave()
    return run.folder / MODEL


def _stop_asked(run: Run, stopped: Callable[[], bool]) -> bool:
    """Several processes stop at the same step, or those left would wait for ever."""
    if run.processes.count == 1:
        return stopped()
    return run.state.step % _LOG_EVERY == 0 and run.processes.any(stopped())


def _save_and_stop(run: Run) -> None:
    if run.processes.leads:
        save_state(run.folder, run.state, run.identity)
    raise StopRequested


def _report(run: Run, progress: Progress, values: dict[str, Any]) -> None:
    try:
        progress(run.state.step, values)
    except (StopRequested, KeyboardInterrupt):
        if run.processes.leads:
            save_state(run.folder, run.state, run.identity)
        raise


@record_function("wildshape: step")
def _step(run: Run, objective: torch.nn.Module) -> Objective:
    """One gradient step; the batch depends on (seed, step, process) alone."""
    state, optim, step = run.state, run.recipe.optim, run.state.step
    _agree_if_due(run)
    with record_function("wildshape: sampling"):
        batch = run.sampler.draw(run.seed, step, run.processes.rank).to(run.processes.device)
    with record_function("wildshape: forward"):
        weight = template_weight(step, optim.steps, run.recipe.loss)
        result: Objective = objective(batch, weight)
    with record_function("wildshape: backward"):
        state.optimiser.zero_grad(set_to_none=True)
        result.loss.backward()
    with record_function("wildshape: optimiser"):
        if optim.clip > 0:
            torch.nn.utils.clip_grad_norm_(state.network.parameters(), optim.clip)
        for group in state.optimiser.param_groups:
            group["lr"] = learning_rate(step, optim)
        state.optimiser.step()
        _average(state, optim.average)
    state.step += 1
    return result


def _agree_if_due(run: Run) -> None:
    """At the recipe's shares of the run, let all tracks agree on which way is front."""
    state, loss = run.state, run.recipe.loss
    due = {int(share * run.recipe.optim.steps) for share in loss.agree_at}
    if state.step in due:
        with record_function("wildshape: headings"):
            state.anchors = agree_on_headings(state.mean, run.sampler, loss)
    run.sampler.anchors = state.anchors


@torch.no_grad()
def _average(state: TrainState, decay: float) -> None:
    """Running mean of the weights, young at first."""
    keep = min(decay, (1 + state.step) / (10 + state.step))
    for mean, now in zip(state.mean.parameters(), state.network.parameters()):
        mean.lerp_(now, 1 - keep)


def checkpoint(run: Run) -> dict[str, Any]:
    """Validate the mean weights and write model and state; returns the figures.

    Raises:
        BadInputError: the weights are no longer finite; the last checkpoint stays.
    """
    if not run.processes.leads:
        run.processes.wait()
        return {}
    device = run.processes.device.type
    found = validate(run.state.mean, run.held_out, run.recipe.loss, _VALIDATION_BATCHES, device)
    _refuse_not_finite(found.observation, run.state.step)
    settings = model_settings(run, found)
    truth = truth_figures(
        run.state.mean, settings, run.sampler.store, run.held_tracks, run.recipe.views.turn
    )
    settings = replace(settings, metrics=settings.metrics | truth)
    save_checkpoint(run.folder / MODEL, run.state.mean, settings)
    save_state(run.folder, run.state, run.identity)
    run.processes.wait()
    return {f"validation/{name}": value for name, value in settings.metrics.items()}


def model_settings(run: Run, found: Validation) -> ModelSettings:
    """What the checkpoint says of itself."""
    recipe = run.recipe
    return ModelSettings(
        network=recipe.network,
        sensor=recipe.views.sensor,
        input_points=recipe.views.points,
        projection=recipe.loss.projection,
        beta=recipe.loss.beta,
        belief=recipe.loss.belief,
        extent_m=run.sampler.extent_range(),
        cost_m=(found.cost_median, found.cost_p90),
        provenance={**run.provenance, "steps": run.state.step, "seed": run.seed},
        metrics=asdict(found),
    )


class Meter:
    """Means over the steps since the last reading, kept on the device."""

    def __init__(self, branches: int) -> None:
        self.branches = branches
        self.started, self.count = time.perf_counter(), 0
        self.sums: list[Tensor] = []
        self.shares: Tensor | None = None

    def add(self, result: Objective) -> None:
        """Add a step."""
        terms = [result.loss.detach(), result.observation, result.projection, result.template]
        wins = torch.bincount(result.winner, minlength=self.branches).float()
        first = self.shares is None
        self.sums = terms if first else [s + t for s, t in zip(self.sums, terms)]
        self.shares = wins if self.shares is None else self.shares + wins
        self.count += 1

    def read(self, step: int) -> dict[str, Any]:
        """The means, and start anew.

        Raises:
            BadInputError: the loss is not finite.
        """
        loss, observation, projection, template = (float(s) / self.count for s in self.sums)
        _refuse_not_finite(loss, step)
        assert self.shares is not None
        shares = (self.shares / self.shares.sum()).tolist()
        rate = self.count / (time.perf_counter() - self.started)
        self.started, self.count, self.shares = time.perf_counter(), 0, None
        return {
            "loss": loss,
            "observation": observation,
            "projection": projection,
            "template": template,
            "branch_shares": [round(share, 4) for share in shares],
            "steps_per_second": rate,
        }


class _Silent:
    """A log that writes nothing, for processes that do not lead."""

    def write(self, step: int, values: dict[str, Any]) -> None:
        """Nothing."""

    def __enter__(self) -> "_Silent":
        return self

    def __exit__(self, *error: object) -> None:
        pass


def _refuse_not_finite(loss: float, step: int) -> None:
    if not np.isfinite(loss):
        raise BadInputError(
            f"training stopped before step {step}: the loss is not finite; resume from the"
            " last checkpoint with a smaller learning rate, or check the data's units."
        )


def _short_hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
