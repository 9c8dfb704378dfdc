# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Steps of self-training on a CPU, on one thread and on several; the weights are the same.

    python benchmarks/bench_teach.py            # two minutes
    python benchmarks/bench_teach.py --small

On several, scans are scored and neighbours searched by all, and the next batch is drawn meanwhile.
torch's sums stay on one thread, as for the weights that ship. True poses and shapes teach: what
teaches changes no time.
"""

from argparse import Namespace
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
IN_A_ROW = 10  # the batch of one alone is drawn while the other one is timed


def simulated(path: Path, tracks: int) -> Store:
    with StoreWriter(path, {}) as store:
        for track in simulate_tracks(SimulationConfig(tracks=tracks, scans=12, rays=512), seed=5):
            store.add(track)
    return open_store(path)


def stepper(run: Run, threads: int, in_a_row: int) -> Callable[[], None]:
    """What takes steps of the run; on one thread nothing is drawn ahead."""
    step, advance = step_of(run, Meter(run.recipe.network.branches, 0, torch.device("cpu")))
    if threads == 1:
        run.views.ahead = lambda: None

    def take() -> None:
        for _ in range(in_a_row):
            with exact_on(threads):
                step.prepare(run.state.step, run.recipe)
                advance()
            run.state.step += 1

    return take


def measure(
    outcome: Outcome, of: str, rays: RayConfig | None, store: Store, folder: Path, size: Namespace
) -> None:
    recipe = PRESETS["default"]()
    recipe = replace(recipe, network=replace(recipe.network, rays=rays))
    in_a_row = 1 if size.smoke else IN_A_ROW
    case, several = f"{of}, {in_a_row} steps", f"{max(2, cores())} threads"
    counts = {several: max(2, cores()), "one thread": 1}
    runs = {name: setup(recipe, store, folder / name, teacher="truth") for name in counts}
    works = {name: stepper(run, counts[name], in_a_row) for name, run in runs.items()}
    outcome.add(case, take_turns(works, 8.0 if size.small else 40.0))
    last = max(3, *(run.state.step for run in runs.values()))
    for name, run in runs.items():
        while run.state.step < last:
            works[name]()
    one, other = (run.state.network.state_dict() for run in runs.values())
    off = max(float((one[name] - other[name]).abs().max()) for name in one)
    outcome.bar(f"{of}: weights after {last} steps off each other", off, 0.0)
    if cores() > 1:
        outcome.at_least(case, several, "one thread", RATIO_BAR)
    else:
        outcome.note(f"not measured: {of}: this machine has one core.")


def main() -> None:
    arguments = begin(options(__doc__))
    torch.set_num_threads(1)
    print(header("bench_teach.py"))
    outcome = Outcome("teach")
    with TemporaryDirectory() as name:
        folder = Path(name)
        store = simulated(folder / "store", 8 if arguments.small else 40)
        for case, rays in (("default", None), ("default, with rays", RayConfig())):
            measure(outcome, case, rays, store, folder / case, arguments)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
