# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A whole training step on the CPU: ours against its plain twin, equal weights and batch.

    python benchmarks/bench_step.py            # six minutes
    python benchmarks/bench_step.py --small    # a minute and a half

A step draws its batch of 8 tracks x 4 scans, and ends with the optimiser and the mean weights.
`plain` is the twin of `plain.py` as one runs it; `plain, kept` has our allocator's setting too.
Each runs in a process of its own (memory is its own, and so is the allocator), and they take turns,
so that busy neighbours hit them alike. Read the ratios.

Of 32 x 1024 maxima a few tie to rounding in float32, and either point may take the gradient. So
gradients are compared with the encoders (all else is as trained) in float64; the last column has
those of float32. For that comparison alone, torch.cdist is kept from rounding by matrix products.
"""

import copy
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from machine import header, median, peak_mib
from outcome import Outcome
from plain import gradients_as_ours, plain_loss, twin_of
from turns import begin, clock_name, now, options, set_clock

from wildshape.io.store.store import open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.network import ShapePoseNet
from wildshape.ops.device import keep_memory
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.batches.views import Batch, ViewSampler
from wildshape.training.config import Recipe
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.recipes import PRESETS

VARIANTS = ("ours", "plain", "plain, kept")
LOSS_BAR, GRADIENT_BAR = 1e-5, 1e-4
STEPS_BARS = {"small": 9.0, "tiny": 22.0}
RATIO_BAR, MEMORY_BAR_MIB = 5.5, 2048.0
PRESETS_MEASURED = ("paper-lidar", "small", "tiny")
SMALL_SECONDS = {"paper-lidar": 25.0, "small": 10.0}
_SEED, _WARM_UP = 0, 2


@dataclass
class Trained:
    """A network, its loss, and a step with it."""

    network: torch.nn.Module
    loss: Callable[[Batch], torch.Tensor]
    gradients: Callable[[], dict[str, torch.Tensor]]


def trained(variant: str, recipe: Recipe, *, exact: bool = False) -> Trained:
    """Networks of the same first weights whatever the variant."""
    torch.manual_seed(_SEED)
    ours = ShapePoseNet(recipe.network)
    if variant == "ours":
        objective = WeaklySupervised(ours, recipe.loss)
        return Trained(
            ours,
            lambda batch: objective(batch).loss,
            lambda: {name: p.grad for name, p in ours.named_parameters() if p.grad is not None},
        )
    plain = twin_of(ours)
    return Trained(
        plain,
        lambda batch: plain_loss(plain, batch, recipe.loss, exact=exact),
        lambda: gradients_as_ours(plain, ours),
    )


def in_double(held: Trained) -> Trained:
    """The same with its encoder in float64; the code goes on in float32."""
    network: Any = held.network
    encode = network.encode
    layers = [network.encoder] if isinstance(held.network, ShapePoseNet) else network.children()
    for layer in layers:
        if not isinstance(layer, torch.nn.Sequential | torch.nn.ModuleList):
            layer.double()
    network.encode = lambda scans, *how: encode(scans.double(), *how).float()
    return held


def serve(
    link: Connection, variant: str, preset: str, store: Path, threads: int, clock: str
) -> None:
    """A process of its own that answers: steps, its peak memory, loss and gradients."""
    torch.set_num_threads(threads)
    set_clock(cpu=clock == "CPU time")
    if variant != "plain":
        keep_memory()
    recipe, opened = PRESETS[preset](), open_store(store)
    sampler = ViewSampler(opened, np.arange(len(opened)), recipe.views)
    stepper = Stepper(trained(variant, recipe), recipe, sampler)
    while (asked := link.recv()) != "end":
        if asked == "step":
            link.send(stepper.step())
        elif asked == "peak":
            link.send(peak_mib())
        else:
            held = trained(variant, recipe, exact=True)
            link.send(gradients(in_double(held) if asked == "float64" else held, sampler))


def gradients(held: Trained, sampler: ViewSampler) -> tuple[float, dict[str, np.ndarray]]:
    """Loss of the first batch, and the gradient of each parameter under our names."""
    loss = held.loss(sampler.draw(_SEED, 0))
    loss.backward()
    return loss.item(), {name: g.detach().float().numpy() for name, g in held.gradients().items()}


class Stepper:
    """Training as `training.loop` does it, for either network."""

    def __init__(self, held: Trained, recipe: Recipe, sampler: ViewSampler) -> None:
        self.held, self.recipe, self.sampler = held, recipe, sampler
        self.optimiser = torch.optim.Adam(held.network.parameters(), lr=recipe.optim.lr, fused=True)
        self.mean, self.done = copy.deepcopy(held.network), 0

    def step(self) -> float:
        """Milliseconds of one step."""
        began, optim, network = now(), self.recipe.optim, self.held.network
        batch = self.sampler.draw(_SEED, self.done)
        loss = self.held.loss(batch)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        if optim.clip > 0:
            torch.nn.utils.clip_grad_norm_(network.parameters(), optim.clip)
        self.optimiser.step()
        average(self.mean, network, optim.average)
        self.done += 1
        return 1e3 * (now() - began)


@torch.no_grad()
def average(mean: torch.nn.Module, network: torch.nn.Module, decay: float) -> None:
    for held, new in zip(mean.parameters(), network.parameters()):
        held.lerp_(new, 1 - decay)


@dataclass
class Row:
    """What was found of one variant; loss and gradients in float32 and with float64 encoders."""

    times: list[float] = field(default_factory=list)
    peak_mib: float = 0.0
    float32: tuple[float, dict[str, np.ndarray]] = (0.0, {})
    float64: tuple[float, dict[str, np.ndarray]] = (0.0, {})


def measure(preset: str, store: Path, threads: int, seconds: float) -> dict[str, Row]:
    """All variants of one preset, turn by turn."""
    links, processes = {}, []
    context = multiprocessing.get_context("spawn")
    for variant in VARIANTS:
        links[variant], theirs = context.Pipe()
        arguments = (theirs, variant, preset, store, threads, clock_name())
        processes.append(context.Process(target=serve, args=arguments, daemon=True))
        processes[-1].start()
    rows = {name: Row() for name in links}
    for _ in range(_WARM_UP):
        for link in links.values():
            ask(link, "step")
    end = time.perf_counter() + seconds
    least = 3 if seconds else 1
    while len(rows["ours"].times) < least or time.perf_counter() < end:
        for name, link in links.items():
            rows[name].times.append(ask(link, "step"))
    for name, link in links.items():
        rows[name].peak_mib = ask(link, "peak")
        rows[name].float32, rows[name].float64 = ask(link, "float32"), ask(link, "float64")
        link.send("end")
    for process in processes:
        process.join()
    return rows


def ask(link: Connection, what: str) -> Any:
    link.send(what)
    return link.recv()


def gradient_difference(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> float:
    """Norm of the difference over the norm, all parameters as one vector."""
    assert set(found) == set(expected)
    apart = sum(float(np.square(found[k] - expected[k], dtype=np.float64).sum()) for k in found)
    size = sum(float(np.square(expected[k], dtype=np.float64).sum()) for k in found)
    return (apart / size) ** 0.5


def report(outcome: Outcome, preset: str, rows: dict[str, Row]) -> None:
    recipe, ours = PRESETS[preset](), rows["ours"]
    case = (
        f"{preset}: {recipe.views.tracks} x {recipe.views.views} scans, n {recipe.views.points},"
        f" m {recipe.network.points}, K {recipe.network.branches}"
    )
    off = {name: differences(ours, row) for name, row in rows.items()}
    outcome.add(
        case,
        {name: row.times for name, row in rows.items()},
        peak_mib={name: row.peak_mib for name, row in rows.items()},
        loss_off={name: found[0] for name, found in off.items()},
        gradient_off={name: found[1] for name, found in off.items()},
        in_float32={name: found[2] for name, found in off.items()},
    )
    loss, gradient, _ = off["plain"]
    outcome.bar(f"{preset}: loss off plain", loss, LOSS_BAR)
    outcome.bar(f"{preset}: gradient off plain", gradient, GRADIENT_BAR)
    if preset in STEPS_BARS:
        rate = 1e3 / median(ours.times)
        bar = STEPS_BARS[preset]
        outcome.bar(f"{preset}: steps a second", rate, bar, least=True, kind="clock")
    if preset == "paper-lidar":
        outcome.at_least(case, "ours", "plain", RATIO_BAR)
        outcome.bar(f"{preset}: peak MiB", ours.peak_mib, MEMORY_BAR_MIB)


def differences(ours: Row, twin: Row) -> tuple[float, float, float]:
    """Relative: of the losses, of the gradients, and of the gradients all in float32."""
    loss = abs(twin.float32[0] - ours.float32[0]) / abs(twin.float32[0])
    gradient = gradient_difference(ours.float64[1], twin.float64[1])
    return loss, gradient, gradient_difference(ours.float32[1], twin.float32[1])


def write_cars(store: Path, tracks: int) -> None:
    with StoreWriter(store, {}) as writer:
        for track in simulate_tracks(SimulationConfig(tracks=tracks), seed=_SEED, workers=1):
            writer.add(track)


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--preset", choices=sorted(PRESETS), action="append")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each preset")
    arguments = begin(parser)
    print(header("bench_step.py"))
    outcome = Outcome("step")
    with TemporaryDirectory() as folder:
        store = Path(folder) / "cars"
        write_cars(store, tracks=8 if arguments.small else 64)
        every = PRESETS_MEASURED[-1:] if arguments.smoke else PRESETS_MEASURED
        for preset in arguments.preset or every:
            seconds = SMALL_SECONDS.get(preset, 5.0) if arguments.small else arguments.seconds
            seconds = 0.0 if arguments.smoke else seconds
            report(outcome, preset, measure(preset, store, arguments.threads, seconds))
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
