# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The whole way in five minutes, ending in one HTML page."""

import time
from dataclasses import dataclass
from pathlib import Path

from wildshape.inference.predictor import Predictor, load
from wildshape.io.output import begin, command_line, provenance, unfinished
from wildshape.io.progress import Progress, duration
from wildshape.io.store.store import open_store
from wildshape.method.checkpoint import SHIPPED
from wildshape.ops.device import choose_device
from wildshape.report.demo.drive import find_vehicles
from wildshape.report.demo.results import draw, evaluate, process, verdict
from wildshape.report.demo.time_budget import TimeBudget
from wildshape.report.demo.tracks import TRAIN, DemoOptions, prepare
from wildshape.training.loop import setup
from wildshape.training.recipes import recipe_for
from wildshape.training.train import Stopping, fit_with_progress

FILES = (
    "report.html",
    *(f"{d}/**/*" for d in ("data", "run", "evaluation", "completed", "fused", "drive")),
)


@dataclass(frozen=True)
class Demo:
    """What came of it: the page, and a sentence on each model."""

    report: Path
    verdict: list[str]


class _Agenda:
    """Says what is being done, how long it took so far and what is left, roughly."""

    def __init__(self, seconds: float, scans: int, progress: Progress) -> None:
        self.began, self.progress = time.monotonic(), progress
        self.left = {
            "making tracks": 12.0,
            "training": seconds + 5,
            "evaluating": 25.0,
            "completing, registering and fusing unseen scans": 15.0,
            "finding all vehicles of a simulated drive": 1.0 * scans,
            "drawing the report": 5.0,
        }

    def next(self, detail: str = "") -> None:
        """Announce the next part."""
        name, left = next(iter(self.left)), sum(self.left.values())
        del self.left[name]
        spent = duration(self.seconds)
        self.progress.say(f"[{spent}] {name}{detail}; about {duration(left)} left in all")

    @property
    def seconds(self) -> float:
        """Since the beginning."""
        return time.monotonic() - self.began


def run_demo(out: Path, options: DemoOptions, progress: Progress, stopping: Stopping) -> Demo:
    """Simulate, train, evaluate, complete, register, fuse, and draw it all in `report.html`.

    At last a whole simulated drive, the vehicles in it found.

    Raises:
        BadInputError: the user's data cannot be used, or a demo is there already.
        StopRequested: `stopping` said so.
    """
    agenda = _Agenda(options.seconds, options.drive_scans, progress)
    overwrite = options.overwrite or unfinished(out, "demo")
    output = begin(out, "demo", {}, FILES, overwrite=overwrite, progress=progress)
    agenda.next()
    with output.abandoned_if_refused():
        data = prepare(out, options, progress)
    agenda.next(f" on {data.described}")
    models = {f"{options.preset}, just trained": _train(out, options, progress, stopping)}
    models |= _shipped(progress)
    agenda.next(f" on {data.tested}")
    results = evaluate(out, models, progress)
    agenda.next()
    shown = process(out, models, results, progress)
    agenda.next()
    driven = find_vehicles(out, options.drive_scans, list(models.values())[-1], progress)
    agenda.next()
    judged = verdict(results, list(models))
    page = draw(out, output, data, shown, results, judged, agenda.seconds, driven)
    output.finish(seconds=round(agenda.seconds, 1))
    return Demo(page, judged)


def _train(out: Path, options: DemoOptions, progress: Progress, stopping: Stopping) -> Predictor:
    """Train for the time given; the run lies in `run/`."""
    store = open_store(out / TRAIN)
    recipe, device = recipe_for(store, options.preset, None), choose_device("auto")
    run = setup(recipe, store, out / "run", device=device, provenance=provenance(command_line()))
    budget = TimeBudget(options.seconds)
    model = fit_with_progress(run, progress, stopping, resume=command_line(), adjust=budget.adjust)
    return load(model, device)


def _shipped(progress: Progress) -> dict[str, Predictor]:
    """The shipped weights, if this checkout has them."""
    if not SHIPPED.is_file():
        progress.say(
            "no weights are shipped with this version; the demo goes on with its own alone"
        )
        return {}
    return {"shipped weights": load()}
