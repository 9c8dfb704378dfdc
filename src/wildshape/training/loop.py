# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training: fit, validate, save. One loop for a CPU, a GPU and several processes."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from torch.profiler import record_function

from wildshape.method.checkpoint import MODEL, ModelSettings, save_checkpoint
from wildshape.training.runtime.log import RunLog
from wildshape.training.runtime.profiler import steps_profiled
from wildshape.training.runtime.running_mean import Meter, refuse_not_finite
from wildshape.training.self_training.headings import agreed_rotations
from wildshape.training.setup import Run, setup, split_tracks, step_of
from wildshape.training.state import TrainState, save_state
from wildshape.training.step import Step
from wildshape.training.validate import Validation, truth_figures, usual_up, validate

__all__ = ["MODEL", "Progress", "Run", "StopRequested", "fit", "setup", "split_tracks"]

_LOG_EVERY = 25
_SAVED_S = 300  # between two checkpoints the state is saved as often: a killed run loses so much
_RARER_ON_A_GPU = 10  # reading figures waits for it, a validation takes as long as 1,000 steps
Progress = Callable[[int, dict[str, Any]], None]


class StopRequested(Exception):  # noqa: N818
    """Raised by a caller's progress function to stop after the current step."""


def fit(
    run: Run, progress: Progress | None = None, stopped: Callable[[], bool] = lambda: False
) -> Path:
    """Train to the last step, validating and saving on the way; returns the checkpoint's path.

    A run that is there already is left as it is: made anew, it would teach others.

    Args:
        run: set up.
        progress: called every 25 steps (on a GPU every 250) with the step and the means since the
            last call.
        stopped: asked after every step; with several processes, as often as `progress` is called.

    Raises:
        StopRequested: `stopped` said so; the state is saved.
        BadInputError: the loss is not finite; the last checkpoint stays.
    """
    model = run.folder / MODEL
    if run.state.step >= run.recipe.optim.steps and model.exists():
        run.processes.leave()
        return model
    meter = Meter(run.recipe.network.branches, run.state.step, run.processes.device)
    step, advance = step_of(run, meter)
    with (
        RunLog(run.folder, run.state.step) if run.processes.leads else _Silent() as log,
        steps_profiled(run.profile) as step_done,
    ):

        def take() -> None:
            _take(run, step, advance)
            step_done()

        loop = Loop(
            state=run.state,
            plan=lambda: (run.recipe.optim.steps, _rarely(run, run.recipe.validate_every)),
            log_every=_rarely(run, _LOG_EVERY),
            take=take,
            save=partial(checkpoint, run),
            halt=partial(_save_state, run),
        )
        try:
            run_to_end(loop, meter, log, progress, partial(_stop_asked, run, stopped))
        finally:
            run.views.close()
    run.processes.leave()
    return model


@dataclass(frozen=True)
class Loop:
    """What a run hands to the loop; DPC has the same one (`baselines/dpc/run.py`).

    Attributes:
        state: its count of steps tells where the run is.
        plan: steps to be taken in all, and from one checkpoint to the next; asked at every step,
            for a time budget may change them.
        log_every: steps from one line of the log to the next.
        take: takes a step, and counts it in the state.
        save: writes model and state; returns what the log says of them.
        halt: writes what a later run goes on from.
    """

    state: TrainState[Any]
    plan: Callable[[], tuple[int, int]]
    log_every: int
    take: Callable[[], None]
    save: Callable[[], dict[str, Any]]
    halt: Callable[[], object]


def run_to_end(
    loop: Loop,
    meter: Meter,
    log: "RunLog | _Silent",
    progress: Progress | None,
    stopped: Callable[[], bool],
) -> None:
    """Step to the end, logging and saving on the way; arguments and errors as of `fit`."""
    state, saved = loop.state, monotonic()
    while state.step < loop.plan()[0]:
        loop.take()
        state.drop_faded()
        now, (steps, save_every) = state.step, loop.plan()
        due = now < steps and now % save_every == 0
        stop = now < steps and stopped()
        # Whatever is saved below, its loss is read before and refused if not finite.
        if due or stop or now % loop.log_every == 0 or now == steps:
            values = meter.read(now)
            log.write(now, values)
            _report(loop, progress, values)
            if not (due or stop or now == steps) and monotonic() - saved >= _SAVED_S:
                _halt(loop)
                saved = monotonic()
        if stop:
            _halt(loop)
            raise StopRequested
        if due:
            _save(loop, log)
            saved = monotonic()
    _save(loop, log)


def _save(loop: Loop, log: "RunLog | _Silent") -> None:
    _refuse_spoilt(loop.state)
    figures = loop.save()
    if figures:
        log.write(loop.state.step, figures)


def _report(loop: Loop, progress: Progress | None, values: dict[str, Any]) -> None:
    try:
        if progress is not None:
            progress(loop.state.step, values)
    except (StopRequested, KeyboardInterrupt):
        if loop.state.step < loop.plan()[0]:  # else an older model beside it would pass as the last
            _halt(loop)
        raise


def _halt(loop: Loop) -> None:
    _refuse_spoilt(loop.state)
    loop.halt()


def _refuse_spoilt(state: TrainState[Any]) -> None:
    """A step may have spoilt the weights of which neither its loss nor figures tell."""
    weights = sum(float(p.detach().sum()) for p in state.network.parameters())
    refuse_not_finite(weights, state.step)


def _rarely(run: Run, every: int) -> int:
    """So many steps; on a GPU ten times as many."""
    return every * _RARER_ON_A_GPU if run.processes.device.type == "cuda" else every


def _stop_asked(run: Run, stopped: Callable[[], bool]) -> bool:
    """Several processes stop at the same step, or those left would wait for ever."""
    if run.processes.count == 1:
        return stopped()
    return run.state.step % _rarely(run, _LOG_EVERY) == 0 and run.processes.any(stopped())


def _save_state(run: Run) -> None:
    if run.processes.leads:
        save_state(run.folder, run.state, run.identity)


@record_function("wildshape: step")
def _take(run: Run, step: Step, advance: Callable[[], None]) -> None:
    """One step; all that is random in it depends on (seed, step, process) alone."""
    _agree_if_due(run)
    step.prepare(run.state.step, run.recipe)
    advance()
    run.state.step += 1


def _agree_if_due(run: Run) -> None:
    """At the recipe's shares of the run, let all tracks agree on which way is front."""
    state, loss = run.state, run.recipe.loss
    due = {int(share * run.recipe.optim.steps) for share in loss.agree_at}
    if state.step in due and run.targets is None:
        with record_function("wildshape: headings"):
            _refuse_spoilt(state)
            rules = run.recipe.self_training.headings
            state.anchors = agreed_rotations(state.mean, run.sampler, loss, rules)
        run.views.hold(state.anchors)


def checkpoint(run: Run) -> dict[str, Any]:
    """Validate the mean weights and write model and state; returns the figures.

    Raises:
        BadInputError: figures are not finite; the last checkpoint stays.
    """
    if not run.processes.leads:
        run.processes.wait()
        return {}
    device = run.processes.device.type
    config, mean = run.recipe.validation, run.state.mean
    found = validate(mean, run.held_out, run.recipe.loss, config.batches, device)
    refuse_not_finite(found.observation, run.state.step)
    settings = model_settings(run, found)
    up = usual_up(mean, settings, run.held_out, config.level_tracks)
    settings = replace(settings, up=up)
    turn = run.recipe.views.turn
    protocol = "yaw" if turn == "facing" else turn  # scans that face their object bear any yaw
    store, held = run.sampler.store, run.held_tracks
    truth = truth_figures(mean, settings, store, held, protocol, config)
    settings = replace(settings, metrics=settings.metrics | truth)
    save_checkpoint(run.folder / MODEL, mean, settings)
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
        facing=recipe.views.turn == "facing",
        belief=recipe.loss.belief,
        extent_m=run.sampler.extent_range(),
        cost_m=(found.cost_median, found.cost_p90),
        provenance={**run.provenance, "steps": run.state.step, "seed": run.seed},
        metrics=asdict(found),
    )


class _Silent:
    """A log that writes nothing, for processes that do not lead."""

    def write(self, step: int, values: dict[str, Any]) -> None:
        """Nothing."""

    def __enter__(self) -> "_Silent":
        return self

    def __exit__(self, *error: object) -> None:
        pass
