# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether `load().compile()` pays here: the first call, one scan and a batch, compiled and not.

    python benchmarks/bench_compile.py    # a minute or more, nearly all of it compiling

`first` includes compiling: with nothing kept from an earlier run, and once more by a new process
that finds the kept code.
"""

import os
import subprocess
import sys
from functools import partial
from tempfile import TemporaryDirectory

import numpy as np
import torch
from machine import header
from outcome import Outcome
from torch import Tensor
from turns import begin, options, set_clock, take_turns, timed

from wildshape.inference.predictor import Predictor, load
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

DIFFERENCE_BAR_M = 1e-4
ROUNDINGS = 8
BATCH = 32


@torch.inference_mode()
def network(made: Predictor, inputs: Tensor) -> None:
    made.network(inputs)


def start(compiling: bool, folder: str, threads: int) -> None:
    """A process of its own that completes one scan."""
    call = ".compile()" if compiling else ""
    program = (
        f"import numpy, torch, wildshape; torch.set_num_threads({threads}); "
        f"wildshape.load(){call}.complete(numpy.random.default_rng(0).normal(size=(200, 3)) + 9)"
    )
    kept = {**os.environ, "TORCHINDUCTOR_CACHE_DIR": folder}
    subprocess.run([sys.executable, "-c", program], env=kept, check=True, capture_output=True)


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_compile.py"))
    outcome, eager = Outcome("compile"), load()
    compiled = eager.compile()
    if compiled.network is eager.network:
        print("not measured: torch found no compiler that works")
        return
    drives = SimulationConfig(tracks=1 if arguments.smoke else 4, scans=8)
    tracks = simulate_tracks(drives, seed=5, workers=1)
    scans = [scan for track in tracks for scan in track.scans][:BATCH]
    raw = load(raw=True)
    apart = largest_difference(raw, raw.compile(), scans)
    outcome.bar(f"network: difference over {len(scans)} scans, m", apart, DIFFERENCE_BAR_M)
    steady = unmoved_by_rounding(eager, scans)
    outcome.note(f"refined: rounding alone moves {len(scans) - len(steady)} of {len(scans)} scans")
    if steady:
        apart = largest_difference(eager, compiled, steady)
        outcome.bar(f"refined: difference over {len(steady)} scans, m", apart, DIFFERENCE_BAR_M)
    else:
        outcome.note("not measured: refined shapes, for rounding alone moves each of them")
    for count in (1, BATCH):
        inputs = torch.randn(count, eager.settings.input_points, 3)
        for name, work in (("network", network), ("complete", complete)):
            given = inputs if work is network else scans[:count]
            works = {
                "eager": partial(work, eager, given),
                "compiled": partial(work, compiled, given),
            }
            outcome.add(f"{name}, {count} scans", take_turns(works, 3.0, at_least=3))
    if not arguments.smoke:
        first_calls(outcome, arguments.threads)
    outcome.publish(arguments.out, small=arguments.small)


def differences(one: Predictor, other: Predictor, scans: list, others: list) -> list[float]:
    """Between the shapes of each scan, metres."""
    pairs = zip(one.complete_many(scans), other.complete_many(others), strict=True)
    return [float(abs(a.points - b.points).max()) for a, b in pairs]


def largest_difference(one: Predictor, other: Predictor, scans: list) -> float:
    return max(differences(one, other, scans, scans))


def unmoved_by_rounding(made: Predictor, scans: list) -> list:
    """Scans of which refinement makes no centimetres from roundings of 1e-7."""
    rng, most = np.random.default_rng(0), np.zeros(len(scans))
    for _ in range(ROUNDINGS):
        rounded = [(s * (1 + rng.uniform(-1e-7, 1e-7, s.shape))).astype(s.dtype) for s in scans]
        most = np.maximum(most, differences(made, made, scans, rounded))
    return [scan for scan, moved in zip(scans, most) if moved <= DIFFERENCE_BAR_M]


def first_calls(outcome: Outcome, threads: int) -> None:
    set_clock(cpu=False)  # the compiler is another process
    with TemporaryDirectory() as folder:
        first = {
            "eager": [timed(partial(start, False, folder, threads))],
            "compiled, nothing kept": [timed(partial(start, True, folder, threads))],
            "compiled, code kept": [timed(partial(start, True, folder, threads))],
        }
    outcome.add("first completion of a process", first)


def complete(made: Predictor, scans: list) -> None:
    list(made.complete_many(scans))


if __name__ == "__main__":
    main()
