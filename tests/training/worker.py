# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One process of a run under torchrun: `-m tests.training.worker STORE OUT`."""

import sys
from dataclasses import replace
from pathlib import Path

import torch
from safetensors.torch import save_file

from wildshape.io.store.store import open_store
from wildshape.method.network import NetworkConfig
from wildshape.method.ray_encoder import RayConfig
from wildshape.training.batches.views import ViewConfig
from wildshape.training.config import OptimConfig
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import tiny

SMALLEST = replace(
    tiny(),
    name="smallest",
    network=NetworkConfig(
        encoder=(16, 16, 32, 32), decoder=(32, 32), pose=(16, 16), points=64, mirror=True, scale=2.0
    ),
    views=ViewConfig(tracks=2, views=2, points=48, turn="yaw"),
    optim=OptimConfig(steps=75, lr=1e-3, decay_every=0, warmup=5, average=0.9, clip=5.0),
    validate_every=30,
)
FEW_STEPS = replace(
    SMALLEST,
    optim=replace(SMALLEST.optim, steps=6),
    loss=replace(SMALLEST.loss, agree_at=()),
)
# A network as that of the shipped weights, of which no scan without a teacher teaches every part.
SEEING = replace(
    FEW_STEPS, network=replace(FEW_STEPS.network, rays=RayConfig(count=8, widths=(8, 8, 8)))
)
SEED = 5


def main(store: Path, out: Path) -> None:
    torch.set_num_threads(1)
    run = setup(SEEING, open_store(store), out, seed=SEED)
    fit(run)
    save_file(run.state.network.state_dict(), out / f"rank{run.processes.rank}.safetensors")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
