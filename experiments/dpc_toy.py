# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC where the answer is known: views of one airplane from a known distance; is the pose found?

    python experiments/dpc_toy.py [--seed 0]
    python experiments/dpc_toy.py --depth 0 --no-half-turn

Of views never trained on it prints the share whose rotation is right within 15 degrees: once the
canonical frame is aligned with the truth's, by the one rotation that suits most of the views
trained on; and between all pairs of views, which needs no alignment. Not the authors': depth images
in the loss beside the silhouettes, and a half turn tried beside the best candidate
(docs/evaluation.md says why); the second line above trains as the authors do.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from wildshape.baselines.dpc.checkpoint import DpcSettings
from wildshape.baselines.dpc.completer import Dpc
from wildshape.baselines.dpc.objective import PRESETS, DpcRecipe
from wildshape.baselines.dpc.run import DpcRun, fit_dpc, setup_dpc
from wildshape.cli.main import in_a_sentence
from wildshape.geometry.transforms.rotation import rotation_angle
from wildshape.io.output import provenance
from wildshape.io.store.store import Store, StoreWriter, open_store
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

TRAINED, TESTED, BATCH, POINTS, VOXELS = 1500, 100, 16, 500, 32
STEPS, RATE = 3000, 1.5e-3
CLOSE_DEG, EVERY, ALIGNED = 15.0, 300, 200


def views_of_an_airplane() -> tuple[Track, Track]:
    """Views to train on, and others of the same airplane."""
    config = SimulationConfig(
        tracks=1, scans=TRAINED + TESTED, sensor="depth-camera", category="airplane"
    )
    track = next(simulate_tracks(config, 1, workers=1))
    return track.part(range(TRAINED)), track.part(range(TRAINED, TRAINED + TESTED))


def toy(options: argparse.Namespace) -> DpcRecipe:
    """The recipe for one object: all views are its own."""
    recipe = PRESETS["dpc-small"]
    network = replace(recipe.network, image=2 * VOXELS, voxels=VOXELS, points=POINTS)
    loss = replace(recipe.loss, depth=options.depth, half_turn=options.half_turn)
    views = replace(recipe.views, tracks=1, views=BATCH, points=4096, window=TRAINED, min_points=16)
    optim = replace(recipe.optim, steps=STEPS, lr=RATE)
    return replace(recipe, network=network, loss=loss, views=views, optim=optim)


def right_share(method: Dpc, trained: Track, tested: Track) -> dict[str, float]:
    """How many rotations of the tested views are right, in the frame that suits those known."""
    known, found = (canonical(method, track) for track in (trained, tested))
    aligned = torch.rad2deg(rotation_angle(most(known).mT @ found))
    pairs = torch.rad2deg(rotation_angle(found[:, None].mT @ found[None]))
    pairs = pairs[~torch.eye(len(found), dtype=torch.bool)]  # none with itself
    return {
        "aligned_within_15": float((aligned < CLOSE_DEG).double().mean()),
        "aligned_within_30": float((aligned < 2 * CLOSE_DEG).double().mean()),
        "aligned_median_deg": float(aligned.median()),
        "aligned_opposed": float((aligned > 120).double().mean()),
        "pairs_within_15": float((pairs < CLOSE_DEG).double().mean()),
    }


def most(rotations: torch.Tensor) -> torch.Tensor:
    """The mean of those within 15 degrees of the one that has most others so near, `(3, 3)`."""
    close = torch.rad2deg(rotation_angle(rotations[:, None].mT @ rotations[None])) < CLOSE_DEG
    mean = rotations[close[close.sum(1).argmax()]].mean(0)
    left, _, right = torch.linalg.svd(mean)
    return left @ torch.diag(left.new_tensor((1, 1, torch.det(left @ right).item()))) @ right


def canonical(method: Dpc, track: Track) -> torch.Tensor:
    """`R_canonical_object` of each view, the same for all where every pose is right; float64."""
    poses = track.T_sensor_object
    assert poses is not None
    return method.poses(track.scans, track.sensor).rotation.double().mT @ poses.rotation


def train(run: DpcRun, trained: Track, tested: Track) -> dict[str, Any]:
    """Train to the end, with a look at the poses now and then."""
    known = trained.part(range(ALIGNED))
    method = Dpc(
        run.state.mean.eval(), DpcSettings(run.recipe.network, depth=run.recipe.loss.depth)
    )

    def report(step: int, values: dict[str, Any]) -> None:
        if step % EVERY == 0:
            shown = {key: values[key] for key in ("silhouette", "depth", "student")}
            shown |= right_share(method, known, tested)
            rounded = {k: round(v, 3) for k, v in shown.items()}
            print(step, values["branch_shares"], rounded, flush=True)

    began, spent = time.perf_counter(), time.process_time()
    fit_dpc(run, report)
    seconds = {
        "seconds": time.perf_counter() - began,
        "processor_seconds": time.process_time() - spent,
    }
    return {**right_share(method, known, tested), **seconds}


def packed(track: Track, folder: Path) -> Store:
    """The track as a store."""
    with StoreWriter(folder / "store", {}) as writer:
        writer.add(track)
    return open_store(folder / "store")


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--depth", type=float, default=4.0, help="weight of the depth image")
    parser.add_argument("--half-turn", action=argparse.BooleanOptionalAction, default=True)
    return parser.parse_args()


def learned(recipe: DpcRecipe, options: argparse.Namespace) -> dict[str, Any]:
    """A network trained from its seed, and what it knows then."""
    trained, tested = views_of_an_airplane()
    with tempfile.TemporaryDirectory() as name:
        run = setup_dpc(recipe, packed(trained, Path(name)), Path(name) / "run", seed=options.seed)
        return train(run, trained, tested)


def main() -> None:
    options = parsed()
    torch.set_num_threads(1)
    found = learned(toy(options), options)
    print({**found, "seed": options.seed, "code": provenance("")["code"]})


if __name__ == "__main__":
    with in_a_sentence():
        main()
