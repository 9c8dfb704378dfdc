# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a teacher said of the scans, kept beside a run so that resuming need not ask again."""

from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from wildshape.io.atomic import atomic_write
from wildshape.method.saved_network import check_numbers, check_shapes
from wildshape.training.batches.fused import FusedTargets

TARGETS = "targets.safetensors"


def save_targets(folder: Path, targets: FusedTargets, identity: dict[str, str]) -> None:
    """Keep the targets beside a run, so that it can be resumed without making them again."""
    tensors = {k: v.contiguous() for k, v in targets._asdict().items() if isinstance(v, Tensor)}
    with atomic_write(folder / TARGETS) as file:
        file.write(save(tensors, {**identity, "complete": str(targets.complete)}))


def load_targets(
    folder: Path, identity: dict[str, str], scans: int, tracks: int
) -> FusedTargets | None:
    """The targets kept beside a run of the same identity; None if there are none, or damaged ones.

    Args:
        folder: of the run.
        identity: says what they were made of.
        scans: of the data.
        tracks: that are trained on.
    """
    path = folder / TARGETS
    if not path.exists():
        return None
    try:
        with safe_open(path, framework="pt") as file:
            found = file.metadata() or {}
            if any(found.get(key) != value for key, value in identity.items()):
                return None
            check_shapes(path, file, _shapes_of(scans, tracks, file))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        check_numbers(path, {k: v for k, v in tensors.items() if k != "view_top"})
        return FusedTargets(**tensors, complete=found.get("complete") == "True")
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
