# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The shipped model in onnxruntime beside torch: the same answers, and how long one scan takes.

    python benchmarks/bench_export.py            # 1,000 simulated scans are compared
    python benchmarks/bench_export.py --small    # 48

`torch` is `Predictor.complete`, box and all; `onnxruntime` is the exported graph from raw points to
completed ones, with the sorting and drawing of points that examples/06_onnx_inference.py does.
"""

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from machine import header
from outcome import Outcome
from turns import begin, options, take_turns

from wildshape.inference.export.onnx import describe, trace, write_onnx
from wildshape.inference.export.verify import Runner, compare, open_exported, prepared
from wildshape.inference.predictor import Predictor, load
from wildshape.records import Points
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

DIFFERENCE_BAR_M = 1e-4


def simulated(count: int) -> list[Points]:
    config = SimulationConfig(tracks=-(-count // 10), scans=10)
    tracks = simulate_tracks(config, seed=4, workers=1)
    return [scan for track in tracks for scan in track.scans][:count]


def exported(predictor: Predictor, threads: int) -> Runner:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.onnx"
        write_onnx(path, trace(predictor), describe(predictor))
        print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB", flush=True)
        return open_exported(path, threads)


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_export.py"))
    outcome, predictor = Outcome("export"), load(raw=True)
    runner = exported(predictor, arguments.threads)
    scans = simulated(8 if arguments.smoke else 48 if arguments.small else 1000)
    found = compare(runner, predictor, scans)
    outcome.bar(
        f"largest difference over {found.scans} scans, m", found.largest_m, DIFFERENCE_BAR_M
    )
    outcome.note(f"{found.other_branch} of {found.scans} scans took another, equally good branch")
    count = predictor.settings.input_points
    for scan in (min(scans, key=len), max(scans, key=len)):
        works = {
            "torch": partial(predictor.complete, scan),
            "onnxruntime": lambda scan=scan: runner(*prepared(scan, count)),
        }
        outcome.add(f"one scan of {len(scan)} points", take_turns(works, 2.0))
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
