# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""All that a training run needs, made from its recipe."""

import copy
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.box import unit_of
from wildshape.io.atomic import write_text
from wildshape.io.progress import counted
from wildshape.io.store.store import Store
from wildshape.method.checkpoint import load_checkpoint
from wildshape.method.network import Encoding, ShapePoseNet
from wildshape.ops.device import keep_memory, multiplies_bf16
from wildshape.parallel.team import cores
from wildshape.training.batches.fused import FusedSampler, FusedTargets
from wildshape.training.batches.host import HostViews
from wildshape.training.batches.resident import ResidentViews, TooLargeError
from wildshape.training.batches.views import ViewSampler
from wildshape.training.config import Recipe
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.runtime.cuda_graph import Captured
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.runtime.torchrun import Processes, join
from wildshape.training.self_training.objective import SelfTaught
from wildshape.training.self_training.posed_parts import PosedParts
from wildshape.training.self_training.pseudo_labels import Fronts, fused_targets
from wildshape.training.self_training.targets import load_targets, save_targets, true_targets
from wildshape.training.state import STATE, TrainState, load_state
from wildshape.training.step import Step, Views

_LOOK_AGAIN_S = 1.0
_RESIDENT_SHARE = 0.5  # of a GPU's memory; the rest is the step's
Say = Callable[[str], None]
Taught = Callable[[int, int], None]


def _silent(_: str) -> None:
    """Say nothing."""


@dataclass
class Run:
    """All that a run needs, set up; `profile` is where to write where a step's time goes.

    Attributes:
        sampler: draws from the tracks that are fitted.
        held_out: draws from those that are not.
        views: give the steps their batches, drawn by `sampler` or as it does.
        targets: what a teacher says of the scans; None trains as the paper does.
        say: is told what a user should know.
    """

    recipe: Recipe
    seed: int
    folder: Path
    processes: Processes
    state: TrainState
    sampler: ViewSampler
    held_out: ViewSampler
    held_tracks: np.ndarray
    views: Views
    targets: FusedTargets | None
    identity: dict[str, str]
    provenance: dict[str, Any]
    say: Say
    profile: Path | None = None


def setup(
    recipe: Recipe,
    store: Store,
    folder: Path,
    *,
    seed: int = 0,
    device: str = "cpu",
    resume: bool = False,
    start: Path | None = None,
    teacher: Path | Literal["truth"] | None = None,
    headings: Path | None = None,
    fronts: Fronts | None = None,
    provenance: dict[str, Any] | None = None,
    taught: Taught = lambda *_: None,
    say: Say = _silent,
) -> Run:
    """Build the network, the optimiser and the samplers; load the state if resuming.

    Args:
        recipe: what to train and how.
        store: the tracks.
        folder: of the run, made if need be.
        seed: of weights and batches.
        device: cpu or cuda.
        resume: go on from the folder's state, if it has one.
        start: checkpoint whose weights are fine-tuned, instead of random ones.
        teacher: checkpoint that poses and fuses the tracks to train on (`pseudo_labels.py`);
            `truth` takes true poses and shapes (the oracle); by default nothing teaches.
        headings: checkpoint of LiDAR scans that is asked which way the scans look, where the
            teacher cannot know (`training/self_training/heading_transfer.py`).
        fronts: where the objects of the store's scans look, sensor frames, if that is known; a
            teacher's poses are turned to look there.
        provenance: written into the run and its checkpoint.
        taught: called with the tracks that the teacher has fused, and their number.
        say: is told what a user should know, a sentence each.

    Raises:
        BadInputError: no usable scans; a state that belongs to another run; or a checkpoint of
            other sizes than the recipe's.
    """
    keep_memory()
    processes = join(device)
    say = say if processes.leads else _silent
    _use_exact_products(processes.device)
    state = _new_state(recipe, start, seed, processes.device)
    fit_tracks, held_tracks = split_tracks(len(store), recipe.held_out)
    identity = _identity(recipe, store, seed, processes, start, teacher)
    if headings is not None:
        identity["headings"] = _short_hash(headings.read_bytes())
    if fronts is not None:
        identity["fronts"] = _short_hash(fronts.numpy().tobytes())
    folder.mkdir(parents=True, exist_ok=True)
    if resume and (folder / STATE).exists():
        load_state(folder, state, identity, store.scan_count)
    sampler = ViewSampler(store, fit_tracks, recipe.views)
    if not _have_scans(store, held_tracks, recipe.views.min_points):
        held_tracks = fit_tracks
    held_out = ViewSampler(store, held_tracks, recipe.views)
    targets = _targets(
        teacher, headings, fronts, sampler, folder, identity, taught, recipe, processes
    )
    views = _views(sampler, targets, seed, processes, recipe, say)
    if state.anchors is not None:
        views.hold(state.anchors)
    described = {"recipe": asdict(recipe), "identity": identity, **(provenance or {})}
    if processes.leads and state.step < recipe.optim.steps:  # a finished run is left as it is
        write_text(folder / "run.json", json.dumps(described, indent=1, default=str))
    if held_tracks is fit_tracks:
        say(
            f"{store.named}: {counted(len(store), 'track')}, of which none is held out: validation"
            " measures what was trained on"
        )
    return Run(
        recipe=recipe,
        seed=seed,
        folder=folder,
        processes=processes,
        state=state,
        sampler=sampler,
        held_out=held_out,
        held_tracks=held_tracks,
        views=views,
        targets=targets,
        identity=identity,
        provenance=described,
        say=say,
    )


def _use_exact_products(device: torch.device) -> None:
    """Geometry is float32 and stays so: no TF32, which knows a car's far end to 2 mm only."""
    if device.type == "cuda":
        torch.set_float32_matmul_precision("highest")
        torch.backends.cuda.matmul.allow_bf16_reduced_precision_reduction = False


def _new_state(recipe: Recipe, start: Path | None, seed: int, device: torch.device) -> TrainState:
    """Network, mean and optimiser; its learning rate lies on the device, for the step to turn."""
    torch.manual_seed(seed)
    network = new_network(recipe, start).to(device)
    rate = torch.tensor(recipe.optim.lr, device=device)
    captured = device.type == "cuda"
    optimiser = torch.optim.Adam(network.parameters(), lr=rate, fused=True, capturable=captured)
    return TrainState(network, copy.deepcopy(network), optimiser)


def _identity(
    recipe: Recipe,
    store: Store,
    seed: int,
    processes: Processes,
    start: Path | None,
    teacher: Path | Literal["truth"] | None,
) -> dict[str, str]:
    """What a state must share with a run that resumes it."""
    return {
        "settings": _short_hash(repr(recipe).encode()),
        "data": store.fingerprint,
        "seed": str(seed),
        "processes": str(processes.count),
        "start": _short_hash(start.read_bytes()) if start else "",
        "teacher": _short_hash(teacher.read_bytes())
        if isinstance(teacher, Path)
        else teacher or "",
    }


def _targets(
    teacher: Path | Literal["truth"] | None,
    headings: Path | None,
    fronts: Fronts | None,
    sampler: ViewSampler,
    folder: Path,
    identity: dict[str, str],
    taught: Taught,
    recipe: Recipe,
    processes: Processes,
) -> FusedTargets | None:
    """Made once a run by one process a machine, and kept beside it; the others wait."""
    config = recipe.self_training
    if teacher is None:
        return None
    if teacher == "truth":
        return true_targets(sampler, config.fusion)
    time_ordered = recipe.loss.time_ordered or recipe.views.sensor == "lidar"
    asked = ("data", "teacher", "headings", "fronts")
    kept = {key: identity[key] for key in asked if key in identity}
    kept["scans"] = _short_hash(np.concatenate(sampler.scans_of).tobytes())
    kept["rules"] = _short_hash(repr((config, time_ordered)).encode())
    load = partial(load_targets, folder, kept, sampler.store.scan_count, len(sampler.scans_of))
    while (found := load()) is None and not processes.leads_here:
        time.sleep(_LOOK_AGAIN_S)  # a barrier gives up before an hour is over
    if found is None:
        parts = PosedParts(folder, kept)
        found = fused_targets(
            teacher,
            sampler,
            taught,
            config,
            time_ordered=time_ordered,
            headings=headings,
            fronts=fronts,
            parts=parts,
        )
        save_targets(folder, found, kept)
        parts.clear()
    return found


def _views(
    sampler: ViewSampler,
    targets: FusedTargets | None,
    seed: int,
    processes: Processes,
    recipe: Recipe,
    say: Say,
) -> Views:
    """On a GPU the scans lie there, if they fit; else every core draws for it."""
    device = processes.device
    workers = 1 if device.type == "cpu" else max(1, cores() // processes.count)
    if targets is not None:
        draw = recipe.self_training.draw
        net = recipe.network
        single = FusedSampler(sampler, targets, draw, mirror=net.mirror, rays=net.rays)
        return HostViews(single, seed, processes.rank, device, workers)
    if device.type != "cuda":
        return HostViews(sampler, seed, processes.rank, device)
    most = int(_RESIDENT_SHARE * torch.cuda.mem_get_info(device)[1])
    try:
        return ResidentViews(sampler, seed, processes.rank, device, most)
    except TooLargeError as error:
        say(f"{error} Batches are drawn on the CPU instead, which is slower.")
        return HostViews(sampler, seed, processes.rank, device, workers)


def step_of(run: Run, meter: Meter) -> tuple[Step, Callable[[], None]]:
    """The run's step, and how its device's part is called: as it is, or recorded and replayed."""
    encoding = _encoding(run)
    network = run.state.network
    if run.targets is None:
        if network.rays is not None:
            network.rays.requires_grad_(False)  # untaught, nothing is drawn for it to see
        objective = WeaklySupervised(network, run.recipe.loss, encoding)
    else:
        unit = unit_of(run.sampler.extent_range()[1])
        rules = run.recipe.self_training.loss
        objective = SelfTaught(network, run.targets.complete, encoding, unit, rules)
    wrapped = run.processes.wrap(objective)
    step = Step(run.state, wrapped, run.views, meter, run.recipe.optim.clip)
    return step, Captured(step.advance, run.say) if _records(run) else step.advance


def _encoding(run: Run) -> Encoding:
    """What the device is good at, as far as the recipe allows."""
    optim = run.recipe.optim
    if run.processes.device.type == "cuda":
        return "bf16" if optim.precision == "bf16" else "static"
    return "winners-bf16" if optim.search == "bf16" and multiplies_bf16() else "winners"


def _records(run: Run) -> bool:
    """Whether the step may be recorded; says so once where a GPU could do more."""
    if run.processes.device.type != "cuda":
        return False
    if run.processes.count == 1 and run.profile is None:
        return True
    why = "is profiled" if run.profile else "is shared by several processes"
    run.say(f"the step {why}, so it is not recorded as a CUDA graph")
    return False


def new_network(recipe: Recipe, start: Path | None) -> ShapePoseNet:
    """A new network, or the checkpoint's; one that sees rays may start from one that does not."""
    if start is None:
        return ShapePoseNet(recipe.network)
    network, settings = load_checkpoint(start)
    if replace(recipe.network, rays=None) == settings.network:
        seeing = ShapePoseNet(recipe.network)  # what it sees of rays is new, if it sees any
        seeing.load_state_dict(network.state_dict(), strict=False)
        return seeing
    if settings.network != recipe.network:
        wanted, found = asdict(recipe.network), asdict(settings.network)
        others = (f"{k} {found[k]} instead of {v}" for k, v in wanted.items() if found[k] != v)
        raise BadInputError(
            f"{start}: its sizes are not those of the preset {recipe.name}: {', '.join(others)};"
            " choose the preset it was trained with."
        )
    return network.train()


def split_tracks(count: int, one_in: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Tracks to fit and tracks held out: one in so many, the same for every seed; all if few."""
    order = np.random.default_rng(0).permutation(count)
    held = count // one_in if count >= one_in else 0
    return (order[held:], order[:held]) if held else (order, order)


def _have_scans(store: Store, tracks: np.ndarray, min_points: int) -> bool:
    """Whether any of the tracks has a scan of so many points."""
    largest = np.maximum.reduceat(store.scan_sizes, store.track_starts[:-1])
    return bool((largest[tracks] >= min_points).any())


def _short_hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
