# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Inference on the CPU: one scan, many scans, and how long a fresh start takes.

    python benchmarks/bench_predict.py            # two minutes
    python benchmarks/bench_predict.py --small    # ten seconds

`network` is centred points in, shape and poses out; `scored` has the cost of every branch too, by
which one is chosen; `complete` is all that the library does with a scan: preparing it, all of that,
the box. Speed does not depend on what the weights have learned: they are random here.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from machine import header, median, p95, verdict
from torch import Tensor

from wildshape.inference.predictor import Predictor
from wildshape.io.ply_writer import write_ply
from wildshape.losses.hindsight import score_hypotheses
from wildshape.models.checkpoint import ModelSettings, save_checkpoint
from wildshape.models.shapepose import ShapePoseNet
from wildshape.records import Points
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.recipes import PRESETS

SIZES = ("paper-lidar", "default", "small")
NETWORK_BARS_MS = {"small": 5.0, "paper-lidar": 20.0}
COMPLETE_BAR_MS = 60.0


def predictor(preset: str) -> Predictor:
    """A predictor of the preset's sizes with random weights."""
    recipe = PRESETS[preset]()
    torch.manual_seed(0)
    settings = ModelSettings(
        network=recipe.network,
        sensor=recipe.views.sensor,
        input_points=recipe.views.points,
        projection=recipe.loss.projection,
        beta=recipe.loss.beta,
        belief=recipe.loss.belief,
    )
    return Predictor(ShapePoseNet(recipe.network).eval(), settings)


def times_ms(work: Callable[[], object], seconds: float, at_least: int = 5) -> list[float]:
    """Milliseconds of each call, three to warm up left out."""
    for _ in range(3):
        work()
    found: list[float] = []
    end = time.perf_counter() + seconds
    while len(found) < at_least or time.perf_counter() < end:
        began = time.perf_counter()
        work()
        found.append(1e3 * (time.perf_counter() - began))
    return found


def scored(made: Predictor, inputs: Tensor) -> Tensor:
    """Cost of every branch of centred scans."""
    network, settings = made.network, made.settings
    code = network.encode(inputs)
    posed = network.poses(code).apply(network.canonical(code))
    centres = torch.tensor([[10.0, 2.0, -1.0]]).expand(len(inputs), 3)
    return score_hypotheses(inputs, centres, posed, settings.projection).cost(settings.beta)


def one_scan(made: Predictor, scan: Points, seconds: float) -> dict[str, list[float]]:
    """Times of the network alone, of the network and its branches' scores, and of all."""
    inputs = torch.randn(1, made.settings.input_points, 3)
    with torch.inference_mode():
        found = {
            "network": times_ms(lambda: made.network(inputs), seconds),
            "scored": times_ms(lambda: scored(made, inputs), seconds),
        }
    return found | {"complete": times_ms(lambda: made.complete(scan), seconds)}


def report_sizes(scans: list[Points], seconds: float) -> None:
    columns = "".join(f"{name + ' ms':>13}{'p95':>8}" for name in ("network", "scored", "complete"))
    print(f"\n{'one scan':<14}{'n':>6}{'m':>6}{columns}{'batched/s':>11}")
    lines: list[str] = []
    for preset in SIZES:
        made = predictor(preset)
        found = one_scan(made, scans[0], seconds)
        rate = scans_a_second(made, scans, seconds)
        cells = "".join(f"{median(times):>13.2f}{p95(times):>8.2f}" for times in found.values())
        sizes = f"{made.settings.input_points:>6}{made.settings.network.points:>6}"
        print(f"{preset:<14}{sizes}{cells}{rate:>11.1f}")
        if preset in NETWORK_BARS_MS:
            name = f"{preset}, network, ms"
            lines.append(verdict(name, median(found["network"]), NETWORK_BARS_MS[preset]))
        lines.append(verdict(f"{preset}, complete, ms", median(found["complete"]), COMPLETE_BAR_MS))
    print("\n".join(lines))


def scans_a_second(made: Predictor, scans: list[Points], seconds: float) -> float:
    times = times_ms(lambda: list(made.complete_many(scans)), seconds, at_least=3)
    return 1e3 * len(scans) / median(times)


def report_starts(scan: Points, repeats: int) -> None:
    """A fresh process each time; files are in the system's cache after the first."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_ply(folder / "scan.ply", scan)
        made = predictor("default")
        save_checkpoint(folder / "model.safetensors", made.network, made.settings)
        complete = ("complete", "scan.ply", "--out", "out", "--overwrite", "--model")
        commands = {
            "python": ("-c", "pass"),
            "import torch": ("-c", "import torch"),
            "import wildshape": ("-c", "import wildshape"),
            "wildshape --help": ("-m", "wildshape.cli", "--help"),
            "wildshape complete": ("-m", "wildshape.cli", *complete, "model.safetensors"),
        }
        print(f"\n{'cold start':<22}{'seconds':>9}{'worst':>9}")
        for label, arguments in commands.items():
            found = [started(arguments, folder) for _ in range(repeats)]
            print(f"{label:<22}{median(found):>9.3f}{max(found):>9.3f}")


def started(arguments: tuple[str, ...], folder: Path) -> float:
    began = time.perf_counter()
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, capture_output=True)
    return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="ten seconds")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    print(header("bench_predict.py"))
    tracks = simulate_tracks(SimulationConfig(tracks=4), seed=0, workers=1)
    scans = [scan for track in tracks for scan in track.scans]
    report_sizes(scans[: 8 if arguments.small else 64], 0.2 if arguments.small else 8.0)
    report_starts(scans[0], 1 if arguments.small else 5)


if __name__ == "__main__":
    main()
