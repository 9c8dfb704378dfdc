# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Inference on the CPU: one scan, many scans, and how long a fresh start takes.

    python benchmarks/bench_predict.py            # two minutes
    python benchmarks/bench_predict.py --small    # half a minute

`network` is centred points in, shape and poses out; `with branch scores` has the cost of every
branch too, by which one is chosen; `complete` is all that the library does with a scan: preparing
it, all of that, the box. Speed does not depend on what the weights have learned: they are random.
"""

import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from machine import header
from outcome import Outcome
from torch import Tensor
from turns import begin, options, set_clock, take_turns, timed

from wildshape.inference.predictor import Predictor
from wildshape.io.scans.writers import write_ply
from wildshape.method.checkpoint import ModelSettings, save_checkpoint
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import ShapePoseNet
from wildshape.records import Points
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.recipes import PRESETS

SIZES = ("small", "default", "paper-lidar")
NETWORK_BARS_MS = {"small": 5.0, "paper-lidar": 20.0}
COMPLETE_BAR_MS = 60.0
COLD_START_BAR = 1.25  # 2 s where torch takes 1.6


def predictor(preset: str) -> Predictor:
    """A predictor of the preset's sizes with random weights; it refines as the preset's do."""
    recipe = PRESETS[preset]()
    torch.manual_seed(0)
    settings = ModelSettings(
        network=recipe.network,
        sensor=recipe.views.sensor,
        input_points=recipe.views.points,
        projection=recipe.loss.projection,
        beta=recipe.loss.beta,
        belief=recipe.loss.belief,
        facing=recipe.views.turn == "facing",
    )
    return Predictor(ShapePoseNet(recipe.network).eval(), settings)


@torch.inference_mode()
def network(made: Predictor, inputs: Tensor) -> None:
    made.network(inputs)


@torch.inference_mode()
def scored(made: Predictor, inputs: Tensor) -> None:
    """Cost of every branch of centred scans."""
    network, settings = made.network, made.settings
    code = network.encode(inputs)
    posed = network.poses(code).apply(network.canonical(code))
    centres = inputs.new_tensor([[10.0, 2.0, -1.0]]).expand(len(inputs), 3)
    score_hypotheses(inputs, centres, posed, settings.projection).cost(settings.beta)


def one_scan(outcome: Outcome, preset: str, scan: Points, seconds: float) -> None:
    made = predictor(preset)
    sizes = f"n {made.settings.input_points}, m {made.settings.network.points}"
    inputs, case = torch.randn(1, made.settings.input_points, 3), f"{preset} ({sizes}), one scan"
    works = {
        "network": partial(network, made, inputs),
        "with branch scores": partial(scored, made, inputs),
        "complete": partial(made.complete, scan),
    }
    outcome.add(case, take_turns(works, seconds))
    if preset in NETWORK_BARS_MS:
        bar = NETWORK_BARS_MS[preset]
        outcome.bar(f"{preset}: network, ms", outcome.median(case, "network"), bar, kind="clock")
    complete = outcome.median(case, "complete")
    outcome.bar(f"{preset}: complete, ms", complete, COMPLETE_BAR_MS, kind="clock")


def many_scans(outcome: Outcome, preset: str, scans: list[Points], seconds: float) -> None:
    """Milliseconds a scan."""
    made = predictor(preset)
    works = {
        "batched": lambda: list(made.complete_many(scans)),
        "one by one": lambda: [made.complete(scan) for scan in scans],
    }
    times = take_turns(works, seconds, at_least=3)
    times = {name: [ms / len(scans) for ms in found] for name, found in times.items()}
    case = f"{preset}, each of {len(scans)} scans"
    rate = {name: 1e3 / min(found) for name, found in times.items()}
    outcome.add(case, times, best_scans_a_second=rate)


def starts(outcome: Outcome, scan: Points, warm: int, repeats: int) -> None:
    """A fresh process each time; files are in the system's cache after the first ones."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_ply(folder / "scan.ply", scan)
        made = predictor("default")
        save_checkpoint(folder / "model.safetensors", made.network, made.settings)
        complete = ("complete", "scan.ply", "--out", "out", "--overwrite", "--model")
        commands = {
            "wildshape complete": ("-m", "wildshape.cli", *complete, "model.safetensors"),
            "import torch": ("-c", "import torch"),
            "import wildshape": ("-c", "import wildshape"),
            "wildshape --help": ("-m", "wildshape.cli", "--help"),
            "python": ("-c", "pass"),
        }
        times = {
            label: [timed(partial(start, arguments, folder)) for _ in range(warm + repeats)][warm:]
            for label, arguments in commands.items()
        }
    outcome.add("cold start", times)
    ratio = min(times["wildshape complete"]) / min(times["import torch"])
    name = "cold start: times the time of import torch"
    outcome.bar(name, ratio, COLD_START_BAR, kind="measured")


def start(arguments: tuple[str, ...], folder: Path) -> None:
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, capture_output=True)


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_predict.py"))
    outcome = Outcome("predict")
    tracks = simulate_tracks(SimulationConfig(tracks=4), seed=0, workers=1)
    scans = [scan for track in tracks for scan in track.scans]
    seconds = 1.5 if arguments.small else 10.0
    count = 4 if arguments.smoke else 32 if arguments.small else 128
    for preset in SIZES:
        one_scan(outcome, preset, scans[0], seconds)
    for preset in SIZES:
        many_scans(outcome, preset, scans[:count], seconds)
    set_clock(cpu=False)  # other processes' time is not ours
    repeats = 1 if arguments.smoke else 2 if arguments.small else 7
    starts(outcome, scans[0], 0 if arguments.smoke else 1, repeats)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
