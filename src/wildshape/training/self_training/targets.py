# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every scan of a training set is to give: from posed tracks, from the truth, from a file.

The file lies beside a run, so that resuming need not ask the teacher again.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor

from wildshape.datasets.tracks.truth import whole_shape
from wildshape.errors import BadInputError
from wildshape.io.atomic import atomic_write
from wildshape.method.saved_network import check_numbers, check_shapes, check_sum, packed, unsummed
from wildshape.training.batches.fused import FusedTargets
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.fused_shape import FusionConfig, exactly, sensors_of
from wildshape.training.self_training.headings import PosedTrack, by_scan

TARGETS = "targets.safetensors"
_DEFAULT = FusionConfig()


def targets_of(
    sampler: ViewSampler,
    tracks: Sequence[PosedTrack],
    shapes: Sequence[np.ndarray],
    tops: Sequence[float],
    config: FusionConfig,
    *,
    complete: bool,
) -> FusedTargets:
    """Posed tracks and their shapes as targets of their scans.

    Args:
        sampler: of the tracks.
        tracks: posed, in the sampler's order.
        shapes: of their objects, `(G, 3)` each, G the same for all, canonical frame, metres.
        tops: slopes at which their views ended above.
        config: how many places of the sensors are kept.
        complete: whether the shapes are whole.
    """
    poses = by_scan(tracks, len(sampler.store.scan_sizes))
    sensors = torch.stack([sensors_of(track, config.sensors) for track in tracks])
    found = torch.from_numpy(np.stack(shapes))
    ends = torch.tensor(list(tops))
    return FusedTargets(poses.rotation, poses.translation, found, sensors, ends, complete=complete)


def true_targets(sampler: ViewSampler, config: FusionConfig = _DEFAULT) -> FusedTargets:
    """The truth as targets: the oracle, the upper bound of METHOD 9.

    Shapes are those that evaluation measures against: partial ones with their reflection, for as
    whole ones they are taught.

    Raises:
        BadInputError: a track has no true poses or no true shape.
    """
    store = sampler.store
    starts = np.asarray(store.track_starts)
    tracks, shapes = [], []
    for scans in sampler.scans_of:
        number = int(np.searchsorted(starts, scans[0], side="right")) - 1
        track = store.track(number)
        known, shape = track.T_sensor_object, whole_shape(track)
        if known is None or shape is None:
            raise BadInputError(
                f"{store.named}: track {track.name} has no true poses or shape; the oracle"
                " needs both."
            )
        own = known[torch.from_numpy(scans - starts[number])].to(torch.float32)
        tracks.append(PosedTrack(scans, own, 0.0))
        shapes.append(exactly(np.asarray(shape), config.points))
    return targets_of(sampler, tracks, shapes, [math.inf] * len(shapes), config, complete=True)


def save_targets(folder: Path, targets: FusedTargets, identity: dict[str, str]) -> None:
    """Keep the targets beside a run, so that it can be resumed without making them again."""
    tensors = {k: v.contiguous() for k, v in targets._asdict().items() if isinstance(v, Tensor)}
    with atomic_write(folder / TARGETS, flush=True) as file:
        complete = str(targets.complete)
        file.write(packed(tensors, complete, {**identity, "complete": complete}))


def load_targets(
    folder: Path, identity: dict[str, str], scans: int, tracks: int
) -> FusedTargets | None:
    """The targets kept beside a run of the same identity; None without, or if they are damaged."""
    path = folder / TARGETS
    if not path.exists():
        return None
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            complete = metadata.get("complete", "")
            if unsummed(metadata) != {**identity, "complete": complete}:
                return None
            check_shapes(path, file, _shapes_of(scans, tracks, file))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        check_numbers(path, {k: v for k, v in tensors.items() if k != "view_top"})
        check_sum(path, tensors, complete, metadata)
        return FusedTargets(**tensors, complete=complete == "True")
    except (SafetensorError, OSError, ValueError, IndexError):
        return None


def _shapes_of(scans: int, tracks: int, file: Any) -> dict[str, Tensor]:
    """Tensors as targets of these tracks have them, of any number of points and places."""
    points, places = (file.get_slice(n).get_shape()[1] for n in ("shapes", "sensors"))
    sizes = {
        "rotation": (scans, 3, 3),
        "translation": (scans, 3),
        "shapes": (tracks, points, 3),
        "sensors": (tracks, places, 3),
        "view_top": (tracks,),
    }
    return {name: torch.empty(size, device="meta") for name, size in sizes.items()}
