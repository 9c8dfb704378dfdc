# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Overfit 8 simulated cars: can the network, the losses and the pose search reach the truth?

    python benchmarks/bench_overfit.py            # 10 minutes of one core
    python benchmarks/bench_overfit.py --small    # one minute, says little

The bar, on the cars trained on: median rotation error of registration <= 3 degrees under random
yaw, CD <= 0.15 m, within 10 CPU minutes.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
import tyro

from wildshape.evaluation import protocol
from wildshape.evaluation.results import summarise
from wildshape.evaluation.tables import markdown
from wildshape.inference.method import Learned
from wildshape.inference.predictor import load
from wildshape.io.provenance import provenance
from wildshape.io.store import open_store
from wildshape.io.store_writer import StoreWriter
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import default


@dataclass(frozen=True)
class Settings:
    """Overfit 8 simulated cars and measure on the same cars.

    Attributes:
        steps: gradient steps; 3,600 take about 9 minutes of one core.
        seed: of the cars and of training.
        small: one minute instead.
    """

    steps: int = 3600
    seed: int = 0
    small: bool = False


def main(settings: Settings) -> None:
    torch.set_num_threads(1)
    steps = 400 if settings.small else settings.steps
    tracks = list(simulate_tracks(SimulationConfig(tracks=8), seed=settings.seed))
    base = default()
    recipe = replace(base, optim=replace(base.optim, steps=steps), validate_every=steps)
    with TemporaryDirectory() as name:
        folder = Path(name)
        with StoreWriter(folder / "cars", provenance("bench_overfit.py")) as store:
            for track in tracks:
                store.add(track)
        began = time.process_time()
        model = fit(setup(recipe, open_store(folder / "cars"), folder / "run", seed=settings.seed))
        minutes = (time.process_time() - began) / 60
        methods = {"wildshape, overfit": Learned(load(model))}
        results = [protocol.run(methods, tracks, rotate="yaw", seed=s) for s in range(3)]
    print(markdown(results))
    row = summarise(results)[0].mean
    print(f"{steps} steps, {minutes:.1f} CPU minutes: {row}")


if __name__ == "__main__":
    main(tyro.cli(Settings))
