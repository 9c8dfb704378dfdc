# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC where the answer is known: views of one airplane from a known distance; is the pose found?

    python experiments/dpc_toy.py [--preset dpc-small] [--steps 4000] [--seed 0] [--depth 1]

Of views never trained on it prints the share whose rotation is right within 15 degrees: once the
canonical frame is aligned with the truth's, by the one rotation for all views that suits most; and
between all pairs of views, which needs no alignment.
"""

import argparse
import tempfile
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

from wildshape.baselines.dpc import Dpc
from wildshape.geometry.rotation import rotation_angle
from wildshape.io.atomic import write_json
from wildshape.io.provenance import provenance
from wildshape.io.store import Store, StoreWriter, open_store
from wildshape.models.dpc_checkpoint import DpcSettings
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.dpc import PRESETS, DpcRecipe
from wildshape.training.dpc_loop import DpcRun, fit_dpc, setup_dpc

TRAINED, TESTED, BATCH = 250, 50, 16
CLOSE_DEG, EVERY = 15.0, 100


def views_of_an_airplane(seed: int) -> tuple[Track, Track]:
    """Views to train on, and others of the same airplane."""
    config = SimulationConfig(
        tracks=1, scans=TRAINED + TESTED, sensor="depth-camera", category="airplane"
    )
    track = next(simulate_tracks(config, seed, workers=1))
    return part(track, slice(0, TRAINED)), part(track, slice(TRAINED, None))


def part(track: Track, rows: slice) -> Track:
    """Some scans of a track."""
    poses = track.T_sensor_object
    assert poses is not None
    return replace(
        track,
        scans=track.scans[rows],
        scan_names=track.scan_names[rows],
        T_sensor_object=poses[rows],
    )


def toy(recipe: DpcRecipe, steps: int, depth: float, voxels: int) -> DpcRecipe:
    """The recipe for one object: all views are its own."""
    network = replace(recipe.network, image=2 * voxels, voxels=voxels)
    views = replace(recipe.views, tracks=1, views=BATCH, points=1024, window=TRAINED, min_points=16)
    return replace(
        recipe,
        network=network,
        loss=replace(recipe.loss, depth=depth),
        views=views,
        optim=replace(recipe.optim, steps=steps),
    )


def right_share(method: Dpc, track: Track) -> dict[str, float]:
    """How many rotations of a track's views are right."""
    poses = track.T_sensor_object
    assert poses is not None
    found = method.poses(track.scans, track.sensor).rotation.double()
    R_canonical_object = found.mT @ poses.rotation
    apart = R_canonical_object[:, None].mT @ R_canonical_object[None]
    error = torch.rad2deg(rotation_angle(apart))
    aligned = error[(error < CLOSE_DEG).sum(1).argmax()]
    return {
        "aligned_within_15": float((aligned < CLOSE_DEG).double().mean()),
        "aligned_within_30": float((aligned < 2 * CLOSE_DEG).double().mean()),
        "aligned_median_deg": float(aligned.median()),
        "pairs_within_15": float((error < CLOSE_DEG).double().mean()),
    }


def train(run: DpcRun, tested: Track) -> dict[str, Any]:
    """Train to the end, with a look at the poses now and then."""
    method = Dpc(run.state.mean.eval(), DpcSettings(run.recipe.network, depth=run.recipe.loss.depth))

    def report(step: int, values: dict[str, Any]) -> None:
        if step % EVERY == 0:
            shown = {key: values[key] for key in ("observation", "projection", "template")}
            rounded = {k: round(v, 3) for k, v in (shown | right_share(method, tested)).items()}
            print(step, values["branch_shares"], rounded, flush=True)

    began, spent = time.perf_counter(), time.process_time()
    fit_dpc(run, report)
    seconds = {
        "seconds": time.perf_counter() - began,
        "processor_seconds": time.process_time() - spent,
    }
    return {**right_share(method, tested), **seconds}


def packed(track: Track, folder: Path) -> Store:
    """The track as a store."""
    with StoreWriter(folder / "store", {}) as writer:
        writer.add(track)
    return open_store(folder / "store")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--preset", choices=("dpc-small", "dpc-dagger-small"), default="dpc-small")
    parser.add_argument("--steps", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--depth", type=float, default=0.0)
    parser.add_argument("--voxels", type=int, default=32)
    parser.add_argument("--rate", type=float, default=1e-3, help="learning rate")
    parser.add_argument("--student", type=float, default=20.0)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    torch.set_num_threads(1)
    trained, tested = views_of_an_airplane(seed=1)
    recipe = toy(PRESETS[options.preset], options.steps, options.depth, options.voxels)
    recipe = replace(
        recipe,
        optim=replace(recipe.optim, lr=options.rate),
        loss=replace(recipe.loss, student=options.student),
    )
    with tempfile.TemporaryDirectory() as name:
        store = packed(trained, Path(name))
        found = train(setup_dpc(recipe, store, Path(name) / "run", seed=options.seed), tested)
    print(found)
    if options.out:
        made = provenance(f"python experiments/dpc_toy.py --seed {options.seed}")
        record = {"found": found, "recipe": asdict(recipe), "provenance": made}
        write_json(options.out, record)


if __name__ == "__main__":
    main()
