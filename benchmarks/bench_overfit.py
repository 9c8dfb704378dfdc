# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Overfit 8 simulated cars: can the network, the losses and the pose search reach the truth?

    python benchmarks/bench_overfit.py            # 10 minutes of one core
    python benchmarks/bench_overfit.py --small    # one minute, too little for its bars

The bars are about the cars trained on, registered under random yaw.
"""

import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from machine import header, judge_speed, verdict
from turns import begin, options

from wildshape.evaluation import protocol
from wildshape.evaluation.summary import summarise
from wildshape.evaluation.tables import markdown
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import load
from wildshape.io.output import provenance
from wildshape.io.store.store import open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import default

STEPS, ROTATION_BAR_DEG, CD_BAR_M, MINUTES_BAR = 3600, 3.0, 0.15, 10.0


def main() -> None:
    parser = options(__doc__)
    parser.set_defaults(threads=1)
    arguments = begin(parser)
    print(header("bench_overfit.py"))
    steps = 4 if arguments.smoke else 400 if arguments.small else STEPS
    judge_speed(wanted=steps >= STEPS)
    scans, seeds = (3, 1) if arguments.smoke else (None, 3)
    tracks = list(simulate_tracks(SimulationConfig(tracks=8, scans=scans), seed=0))
    base = default()
    recipe = replace(base, optim=replace(base.optim, steps=steps), validate_every=steps)
    with TemporaryDirectory() as name:
        folder = Path(name)
        with StoreWriter(folder / "cars", provenance("bench_overfit.py")) as store:
            for track in tracks:
                store.add(track)
        began = time.process_time()
        model = fit(setup(recipe, open_store(folder / "cars"), folder / "run"))
        minutes = (time.process_time() - began) / 60
        methods = {"wildshape, overfit": Learned(load(model))}
        results = [protocol.run(methods, tracks, rotate="yaw", seed=s) for s in range(seeds)]
    print(markdown(results))
    row = summarise(results)[0].mean
    print(f"{steps} steps, {minutes:.1f} CPU minutes: {row}")
    print(
        verdict("rotation error, degrees", row["rot_median_deg"], ROTATION_BAR_DEG, kind="measured")
    )
    print(verdict("CD, m", row["cd"], CD_BAR_M, kind="measured"))
    print(verdict("training, CPU minutes", minutes, MINUTES_BAR, kind="clock"))


if __name__ == "__main__":
    main()
