# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Train on a folder of tracks, without labels; without an argument on simulated ones.

python examples/03_train_on_a_folder.py [DATASET [RUN [STEPS [PRESET]]]]
"""

import sys
from dataclasses import replace
from pathlib import Path

import wildshape
from wildshape.io.inputs import open_tracks
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import PRESETS


def main(dataset: str = "", run: str = "run", steps: int = 1000, preset: str = "small") -> None:
    drives = SimulationConfig(tracks=20, scans=12)
    tracks = open_tracks(dataset) if dataset else simulate_tracks(drives, seed=1)
    with StoreWriter(Path(run) / "data.store", {}) as writer:
        for track in tracks:
            writer.add(track)
    recipe = PRESETS[preset]()
    recipe = replace(recipe, optim=replace(recipe.optim, steps=int(steps)))
    prepared = setup(recipe, open_store(writer.path), Path(run), seed=0)
    model = fit(prepared, lambda step, values: print(f"step {step}: loss {values['loss']:.3f}"))
    done = wildshape.load(model).complete(open_store(writer.path).track(0).scans[0])
    print(f"{model} completes a scan with {len(done.points)} points")


if __name__ == "__main__":
    main(*sys.argv[1:])
