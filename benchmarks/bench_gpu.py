# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training and inference on a GPU; says so and ends where there is none.

    python benchmarks/bench_gpu.py                     # five minutes
    python benchmarks/bench_gpu.py --small             # one
    python benchmarks/bench_gpu.py --smoke             # the same lines, also on a CPU: tried

`captured` is the step as `wildshape train` runs it; `eager` the same, not recorded as a CUDA graph;
`plain` the twin of `plain.py`, cdist and all, on the same batches. `side by side` are runs of other
seeds, each on a stream of its own; its time is that of a step of any of them.
"""

import copy
import time
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from bench_predict import predictor, scored
from bench_step import write_cars
from device_time import laps, wait
from machine import header
from no_wait import NoWait
from outcome import Outcome
from plain import plain_loss, twin_of
from torch import Tensor
from turns import begin, options

from wildshape.io.store.store import Store, open_store
from wildshape.ops.nearest import nearest
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.config import Recipe, learning_rate
from wildshape.training.recipes import PRESETS
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.setup import Run, setup, step_of

STEP_BARS_MS = {"paper-lidar": 1.2, "paper-views": 2.0}
PLAIN_BAR, SIDE_BY_SIDE_BAR, CDIST_BAR = 5.0, 2.0, 5.0
SCANS_BAR, LOSS_BAR, ALL_STEPS_BAR_MIN = 20_000, 1e-3, 8.0
PAIRS_BAR = 0.6 * 3.9e12  # of what 8.5 instructions a pair allow on an H200
AGREE = 100


@dataclass(frozen=True)
class Size:
    """How much is measured."""

    steps: int
    scans: int
    nearest: tuple[int, int, int]
    seeds: int


FULL = Size(2000, 1024, (128, 1024, 2048), 3)
SMALL = Size(300, 256, (128, 1024, 2048), 3)
TINY = Size(6, 4, (2, 64, 64), 2)


def prepared(recipe: Recipe, store: Store, device: str, seed: int = 0) -> Run:
    """What `wildshape train` would begin with."""
    with TemporaryDirectory() as folder:
        return setup(recipe, store, Path(folder), seed=seed, device=device, say=print)


class Trainer:
    """A run's steps, one call each."""

    def __init__(self, run: Run, *, captured: bool = True) -> None:
        self.run, self.taken = run, 0
        self.meter = Meter(run.recipe.network.branches, 0, run.processes.device)
        self.step, advance = step_of(run, self.meter)
        self.advance = advance if captured else self.step.advance

    def __call__(self) -> None:
        self.step.prepare(self.taken, self.run.recipe)
        self.advance()
        self.taken += 1


class PlainTrainer:
    """The plain twin's steps on the same batches, from the same weights."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.network = twin_of(run.state.network).to(run.processes.device)
        self.mean = copy.deepcopy(self.network)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=run.recipe.optim.lr)
        self.losses: list[Tensor] = []

    def loss(self) -> Tensor:
        """Of the next step's batch."""
        run, number = self.run, len(self.losses)
        run.views.prepare(number)
        batch = run.views.batch(torch.tensor(number, device=run.processes.device))
        return plain_loss(self.network, batch, run.recipe.loss)

    def __call__(self) -> None:
        number, optim, loss = len(self.losses), self.run.recipe.optim, self.loss()
        self.optimiser.zero_grad()
        loss.backward()
        if optim.clip > 0:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), optim.clip)
        self.optimiser.param_groups[0]["lr"] = learning_rate(number, optim)
        self.optimiser.step()
        with torch.no_grad():
            for mean, now in zip(self.mean.parameters(), self.network.parameters()):
                mean.lerp_(now, 1 - min(optim.average, (1 + number) / (10 + number)))
        self.losses.append(loss.detach())


def steps(outcome: Outcome, recipe: Recipe, store: Store, size: Size, device: str) -> None:
    case = f"{recipe.name}: a step"
    began = time.perf_counter()
    captured = Trainer(prepared(recipe, store, device))
    laps(captured, 5, device)
    start = time.perf_counter() - began
    outcome.note(f"{recipe.name}: set up and recorded after {start:.1f} s; {launches(captured)}")
    eager = Trainer(prepared(recipe, store, device), captured=False)
    plain = PlainTrainer(prepared(recipe, store, device))
    few = max(5, size.steps // 10)
    for work in (eager, plain):
        laps(work, 3, device)
    began = time.perf_counter()
    times = {"captured": laps(captured, size.steps, device)}
    took = (time.perf_counter() - began) / size.steps
    times |= {"eager": laps(eager, few, device), "plain": laps(plain, few, device)}
    outcome.add(case, times)
    if recipe.name in STEP_BARS_MS:
        bar = STEP_BARS_MS[recipe.name]
        outcome.bar(f"{case}, ms", outcome.median(case, "captured"), bar, kind="clock")
    if recipe.name == "paper-lidar":
        outcome.at_least(case, "captured", "plain", PLAIN_BAR)
        minutes = (start + took * PRESETS["paper-lidar"]().optim.steps) / 60
        name = "paper-lidar: all steps without validation, min"
        outcome.bar(name, minutes, ALL_STEPS_BAR_MIN, kind="clock")


def launches(trainer: Trainer) -> str:
    """How many operations a step starts; counted while it runs as it is."""
    trainer.step.prepare(trainer.taken, trainer.run.recipe)
    with NoWait(strict=False) as watch:
        trainer.step.advance()
    trainer.taken += 1
    return f"{watch.launched.total()} operations that are no views, a step"


def agreement(outcome: Outcome, recipe: Recipe, store: Store, count: int, device: str) -> None:
    """Loss by loss on the same batches: at the same weights; and each going its own way.

    On their own ways rounding alone, by the branch that wins a near tie, parts any two runs.
    """
    free, judge = (PlainTrainer(prepared(recipe, store, device)) for _ in range(2))
    for precision in ("bf16", "fp32"):
        held = replace(recipe, optim=replace(recipe.optim, precision=precision))
        fast = Trainer(prepared(held, store, device))
        judge.losses = []
        for _ in range(count):
            judge.network.load_state_dict(twin_of(fast.run.state.network).state_dict())
            judge.losses.append(judge.loss().detach())
            fast()
        while len(free.losses) < count:
            free()
        found, name = fast.meter.losses(0, count), f"{recipe.name}: losses of {count} steps"
        same, own = (
            float(((found - torch.stack(t.losses).cpu()).abs() / found).max())
            for t in (judge, free)
        )
        outcome.bar(f"{name} off by, {precision}", same, LOSS_BAR)
        outcome.note(f"{name}, each going its own way, {precision}: off by {own:.1e}")


def side_by_side(outcome: Outcome, recipe: Recipe, store: Store, size: Size, device: str) -> None:
    """Several seeds on one card: each on its own stream, their steps taken in turn."""
    runs = []
    for seed in range(size.seeds):
        stream = torch.cuda.stream(torch.cuda.Stream()) if device == "cuda" else nullcontext()
        runs.append((stream, Trainer(prepared(recipe, store, device, seed))))
    wait(device)

    def everyone(taking_part: int) -> None:
        for stream, trainer in runs[:taking_part]:
            with stream:
                trainer()

    for _ in range(5):
        everyone(size.seeds)
    rates = {}
    for taking_part in (1, size.seeds):
        wait(device)
        began, rounds = time.perf_counter(), max(2, size.steps // 4)
        for _ in range(rounds):
            everyone(taking_part)
        wait(device)
        rates[taking_part] = rounds * taking_part / (time.perf_counter() - began)
    case = f"{recipe.name}: a step of any seed"
    outcome.add(case, {f"{k} side by side": [1e3 / rate] for k, rate in rates.items()})
    ratio = rates[size.seeds] / rates[1]
    name = f"{case}: throughput of {size.seeds} / 1"
    outcome.bar(name, ratio, SIDE_BY_SIDE_BAR, least=True, kind="measured")


def search(outcome: Outcome, shape: tuple[int, int, int], device: str) -> None:
    B, N, M = shape
    query, target = torch.randn(B, N, 3, device=device), torch.randn(B, M, 3, device=device)
    works = {"ours": lambda: nearest(query, target), "cdist": lambda: farthest(query, target)}
    if device == "cuda":
        compiled = torch.compile(farthest)
        works["cdist, compiled"] = lambda: compiled(query, target)
    times = {name: laps(work, 25, device)[5:] for name, work in works.items()}
    pairs = {name: B * N * M / min(found) / 1e9 for name, found in times.items()}
    case = f"nearest neighbours, {B} x {N} x {M}"
    outcome.add(case, times, best_tera_pairs_a_second=pairs)
    found = B * N * M / outcome.median(case, "ours") * 1e3
    outcome.bar(f"{case}: pairs a second", found, PAIRS_BAR, least=True, kind="clock")
    outcome.at_least(case, "ours", "cdist", CDIST_BAR)


def farthest(query: Tensor, target: Tensor) -> Tensor:
    return torch.cdist(query, target).argmin(2)


def completion(outcome: Outcome, preset: str, size: Size, device: str) -> None:
    """Milliseconds a scan: scans on the device, and from numpy to completions."""
    made = predictor(preset)
    made.network.to(device)
    made.device = torch.device(device)
    inputs = torch.randn(size.scans, made.settings.input_points, 3, device=device)
    cars = simulate_tracks(SimulationConfig(tracks=1), seed=0, workers=1)
    scans = [scan for track in cars for scan in track.scans] * (1 + size.scans // 8)
    works = {
        "network": lambda: made.network(inputs),
        "with branch scores": lambda: scored(made, inputs),
        "complete_many": lambda: list(made.complete_many(scans[: size.scans])),
    }
    with torch.inference_mode():
        times = {name: laps(work, 6, device)[1:] for name, work in works.items()}
    each = {name: [ms / size.scans for ms in found] for name, found in times.items()}
    case = f"{preset}: each of {size.scans} scans"
    rate = {name: 1e3 / min(found) for name, found in each.items()}
    outcome.add(case, each, best_scans_a_second=rate)
    found = 1e3 / outcome.median(case, "with branch scores")
    outcome.bar(f"{case}: scans a second", found, SCANS_BAR, least=True, kind="clock")


def smallest() -> Recipe:
    """The tiny preset at a fraction of its batch."""
    tiny = PRESETS["tiny"]()
    return replace(tiny, views=replace(tiny.views, tracks=2, views=2, points=64))


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--device", choices=("cuda", "cpu"))
    arguments = begin(parser)
    arguments.device = arguments.device or ("cpu" if arguments.smoke else "cuda")
    if arguments.device == "cuda" and not torch.cuda.is_available():
        print("No GPU here: bench_gpu.py measures nothing.")
        return
    print(header("bench_gpu.py"))
    size = TINY if arguments.smoke else SMALL if arguments.small else FULL
    recipes = [PRESETS[name]() for name in ("paper-lidar", "paper-views", "default")]
    if arguments.smoke:
        recipes = [smallest()]
    outcome, device, began = Outcome("gpu"), arguments.device, time.perf_counter()

    def at(what: str) -> None:
        outcome.note(f"{what} after {time.perf_counter() - began:.0f} s")

    with TemporaryDirectory() as folder:
        write_cars(Path(folder) / "cars", tracks=2 if arguments.smoke else 64)
        store = open_store(Path(folder) / "cars")
        for recipe in recipes:
            steps(outcome, recipe, store, size, device)
            at(recipe.name)
        agreement(outcome, recipes[0], store, min(size.steps, AGREE), device)
        at("losses")
        side_by_side(outcome, recipes[0], store, size, device)
        at("side by side")
    search(outcome, size.nearest, device)
    at("searches")
    for preset in ("tiny",) if arguments.smoke else ("paper-lidar", "default"):
        completion(outcome, preset, size, device)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
