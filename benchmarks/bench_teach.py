# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A step of self-training on a CPU, on one thread and on several; the weights are the same.

    python benchmarks/bench_teach.py            # two minutes
    python benchmarks/bench_teach.py --small

On several, scans are scored and neighbours searched by all, and the next batch is drawn meanwhile.
torch's sums stay on one thread, as for the weights that ship. True poses and shapes teach: what
teaches changes no time.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from machine import header
from outcome import Outcome
from turns import begin, options, take_turns

from wildshape.io.store.store import Store, open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.ray_encoder import RayConfig
from wildshape.ops.threads import exact_on
from wildshape.parallel.team import cores
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.recipes import PRESETS
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.setup import Run, setup, step_of

RATIO_BAR = 1.25


def simulated(path: Path, tracks: int) -> Store:
    with StoreWriter(path, {}) as store:
        for track in simulate_tracks(SimulationConfig(tracks=tracks, scans=12, rays=512), seed=5):
            store.add(track)
    return open_store(path)


def stepper(run: Run, threads: int) -> Callable[[], None]:
    """What takes a step of the run; on one thread nothing is drawn ahead."""
    step, advance = step_of(run, Meter(run.recipe.network.branches, 0, torch.device("cpu")))
    if threads == 1:
        run.views.ahead = lambda: None

    def take() -> None:
        with exact_on(threads):
            step.prepare(run.state.step, run.recipe)
            advance()
        run.state.step += 1

    return take


def measure(
    outcome: Outcome, case: str, rays: RayConfig | None, store: Store, folder: Path, seconds: float
) -> None:
    recipe = PRESETS["default"]()
    recipe = replace(recipe, network=replace(recipe.network, rays=rays))
    several = f"{max(2, cores())} threads"
    counts = {several: max(2, cores()), "one thread": 1}
    runs = {name: setup(recipe, store, folder / name, teacher="truth") for name in counts}
    works = {name: stepper(run, counts[name]) for name, run in runs.items()}
    outcome.add(case, take_turns(works, seconds))
    last = max(3, *(run.state.step for run in runs.values()))
    for name, run in runs.items():
        while run.state.step < last:
            works[name]()
    one, other = (run.state.network.state_dict() for run in runs.values())
    off = max(float((one[name] - other[name]).abs().max()) for name in one)
    outcome.bar(f"{case}: weights after {last} steps off each other", off, 0.0)
    if cores() > 1:
        outcome.at_least(case, several, "one thread", RATIO_BAR)
    else:
        outcome.note(f"not measured: {case}: this machine has one core.")


def main() -> None:
    arguments = begin(options(__doc__))
    torch.set_num_threads(1)
    print(header("bench_teach.py"))
    outcome = Outcome("teach")
    seconds = 8.0 if arguments.small else 40.0
    with TemporaryDirectory() as name:
        folder = Path(name)
        store = simulated(folder / "store", 8 if arguments.small else 40)
        for case, rays in (("default", None), ("default, with rays", RayConfig())):
            measure(outcome, case, rays, store, folder / case, seconds)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
