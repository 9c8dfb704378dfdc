# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A run of DPC from its recipe to its checkpoint, on one process, by the common loop."""

import copy
import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.baselines.dpc.checkpoint import DpcSettings, save_dpc
from wildshape.baselines.dpc.network import DpcNet
from wildshape.baselines.dpc.objective import DpcObjective, DpcRecipe
from wildshape.baselines.dpc.viewing_volume import PinholeVolume, inside, offsets, to_volume
from wildshape.errors import BadInputError
from wildshape.io.atomic import write_text
from wildshape.io.store.store import Store
from wildshape.training.batches.views import ViewSampler
from wildshape.training.config import learning_rate
from wildshape.training.loop import MODEL, Loop, Progress, run_to_end
from wildshape.training.recipes import refuse_other_sensor, sensor_kind
from wildshape.training.runtime.log import RunLog
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.setup import split_tracks
from wildshape.training.state import STATE, TrainState, load_state, save_state
from wildshape.training.step import average_one_by_one

_LOG_EVERY = 25
_LOOKED_AT, _SEEN = 64, 0.9  # scans, and the share of their points that the image must hold


@dataclass
class DpcRun:
    """All that a run needs, set up.

    Attributes:
        seed: of weights and batches.
        folder: where the results go.
        state: network, its running mean and the optimiser.
        identity: what a state must share with a run that resumes it.
        provenance: written into the checkpoint.
    """

    recipe: DpcRecipe
    seed: int
    folder: Path
    state: TrainState[DpcNet]
    sampler: ViewSampler
    identity: dict[str, str]
    provenance: dict[str, Any]


def setup_dpc(
    recipe: DpcRecipe,
    store: Store,
    folder: Path,
    *,
    seed: int = 0,
    device: str = "cpu",
    resume: bool = False,
    provenance: dict[str, Any] | None = None,
) -> DpcRun:
    """Build the network and the sampler; load the state if resuming.

    Raises:
        BadInputError: no usable scans, another kind of sensor or two, objects outside of the
            images, or a state that belongs to another run.
    """
    sampler = ViewSampler(store, split_tracks(len(store))[0], recipe.views)
    _refuse_unseen(recipe, store, sampler)
    torch.manual_seed(seed)
    network = DpcNet(recipe.network).to(device)
    optimiser = torch.optim.Adam(network.parameters(), lr=recipe.optim.lr)
    state = TrainState(network, copy.deepcopy(network), optimiser)
    settings = hashlib.sha256(repr(recipe).encode()).hexdigest()[:16]
    identity = {"settings": settings, "data": store.fingerprint, "seed": str(seed)}
    folder.mkdir(parents=True, exist_ok=True)
    if resume and (folder / STATE).exists():
        load_state(folder, state, identity, store.scan_count)
    described = {"recipe": asdict(recipe), "identity": identity, **(provenance or {})}
    if state.step < recipe.optim.steps:  # a finished run is left as it is
        write_text(folder / "run.json", json.dumps(described, indent=1, default=str))
    return DpcRun(recipe, seed, folder, state, sampler, identity, described)


def fit_dpc(
    run: DpcRun, report: Progress | None = None, stopped: Callable[[], bool] = lambda: False
) -> None:
    """As `fit` of all trainings, whose loop it is; a finished run stays as it is.

    Raises:
        StopRequested: `stopped` said so; model and state are saved.
        BadInputError: the loss is not finite; the last checkpoint stays.
    """
    state, save = run.state, partial(_save, run)
    if state.step >= run.recipe.optim.steps and (run.folder / MODEL).is_file():
        return
    device = next(state.network.parameters()).device
    objective = DpcObjective(state.network, run.recipe.loss)
    meter = Meter(run.recipe.network.candidates, state.step, device)
    take = partial(_take, run, objective, meter)
    plan = (run.recipe.optim.steps, run.recipe.save_every)
    loop = Loop(state, lambda: plan, _LOG_EVERY, take, save, save)
    with RunLog(run.folder, state.step) as log:
        run_to_end(loop, meter, log, report, stopped)


def _take(run: DpcRun, objective: DpcObjective, meter: Meter) -> None:
    """One step; all that is random in it depends on (seed, step) alone."""
    state, optim = run.state, run.recipe.optim
    state.optimiser.param_groups[0]["lr"] = learning_rate(state.step, optim)
    device = meter.ring.device
    batch = run.sampler.draw(run.seed, state.step).to(device)
    # Torch takes 64 bits; the batch and the weights know those of a seed that are cut off here.
    generator = torch.Generator().manual_seed((run.seed << 32 | state.step) % (1 << 64))
    result = objective(batch, state.step / optim.steps, generator)
    state.optimiser.zero_grad(set_to_none=True)
    result.loss.backward()
    state.optimiser.step()
    mean: list[torch.Tensor] = list(state.mean.parameters())
    now: list[torch.Tensor] = list(state.network.parameters())
    average_one_by_one(mean, now, torch.tensor(1 - optim.average, device=device))
    for held, new in zip(state.mean.buffers(), state.network.buffers()):
        held.copy_(new)
    meter.write(torch.tensor(state.step, device=device), result)
    state.step += 1


def _save(run: DpcRun) -> dict[str, Any]:
    """Write the checkpoint and the state; there are no figures of them."""
    provenance = {**run.provenance, "steps": run.state.step, "seed": run.seed}
    recipe, loss = run.recipe, run.recipe.loss
    settings = DpcSettings(recipe.network, recipe.name, loss.depth, provenance, loss.half_turn)
    save_dpc(run.folder / MODEL, run.state.mean, settings)
    save_state(run.folder, run.state, run.identity)
    return {}


def _refuse_unseen(recipe: DpcRecipe, store: Store, sampler: ViewSampler) -> None:
    """DPC knows neither other sensors nor where an object is."""
    refuse_other_sensor(store.named, sensor_kind(store), recipe.views.sensor, recipe.name)
    volume = recipe.network.volume
    rng = np.random.default_rng(0)
    rows = rng.choice(np.concatenate(sampler.scans_of), size=_LOOKED_AT)
    scans, centres = sampler.gather_as_posed([int(row) for row in rows], rng)[:2]
    cube = to_volume(scans + centres[:, None], offsets(centres, volume), volume)
    if float(inside(cube).float().mean()) >= _SEEN:
        return
    told = (
        f"a camera that looks at objects of size {volume.scale:g} from {volume.distance:g} away"
        if isinstance(volume, PinholeVolume)
        else f"objects of at most {volume.scale:g} m"
    )
    raise BadInputError(
        f"{store.named}: most of its objects lie outside of DPC's images, which need {told}; train"
        " a preset of Wildshape's own instead."
    )
