# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which weights, on which device, compiled or not (docs/models.md)."""

import hashlib
import warnings
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import torch
from torch import nn

from wildshape.errors import BadInputError
from wildshape.method.network import ShapePoseNet

MODEL = "model.safetensors"
"""The checkpoint in the folder of a training run."""

_WEIGHTS = Path(__file__).parent.parent / "weights"
SHIPPED = _WEIGHTS / "default.safetensors"
_BATCHES = (1, 2)  # torch compiles a batch of one by itself, and all others together


def weights_file(model: str | Path | None) -> Path:
    """The checkpoint meant: a file, a run's folder, shipped weights by name, or the default ones.

    What exists goes before a name.

    Raises:
        BadInputError: none of these; names the weights that are shipped.
    """
    path = Path(model) if model is not None else SHIPPED
    if path.is_dir():
        return path / MODEL
    named = _WEIGHTS / f"{path.name}.safetensors"
    bare = path.name == str(path) and not path.exists()
    if bare and named.is_file():
        return named
    if not path.exists():
        shipped = ", ".join(sorted(file.stem for file in _WEIGHTS.glob("*.safetensors")))
        raise BadInputError(
            f"{path}: no such checkpoint; name a .safetensors file, the folder of a run, or one of"
            f" those shipped: {shipped}."
        )
    return path


def fingerprint(model: Path | None) -> str:
    """Short hash of the checkpoint's bytes; empty if there is no such file."""
    path = weights_file(model)
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def choose_device(device: str) -> str:
    """What torch calls it; `auto` is the GPU where there is one.

    Raises:
        BadInputError: a GPU is asked for, and torch finds none.
    """
    found = torch.cuda.is_available()
    if device.startswith("cuda") and not found:
        raise BadInputError(f"--device {device}: torch finds no GPU here; use --device cpu.")
    if device == "auto":
        return "cuda" if found else "cpu"
    return device


def compiled(
    network: ShapePoseNet, points: int, backend: "str | Callable[..., Any]" = "inductor"
) -> ShapePoseNet:
    """A copy that computes the same, compiled when this returns; or the network itself.

    Where torch finds no compiler, a RuntimeWarning says so and nothing is lost.

    Args:
        network: as trained.
        points: of a scan.
        backend: of `torch.compile`.
    """
    copied = deepcopy(network)
    for part in (copied.encoder, copied.shape, copied.pose):
        part.compile(backend=backend, dynamic=True)
    try:
        _rehearse(copied, points)
    except RuntimeError as error:  # torch's own errors of compiling are of this kind
        reason = " ".join(str(error).split()).split(" Set TORCHDYNAMO")[0][:200]
        warnings.warn(
            f"the network runs uncompiled: torch.compile cannot work here ({reason}); it needs a"
            " C++ compiler, on a GPU Triton.",
            RuntimeWarning,
            stacklevel=3,
        )
        return network
    return copied


@torch.inference_mode()
def _rehearse(network: nn.Module, points: int) -> None:
    device = next(network.parameters()).device
    for batch in _BATCHES:
        network(torch.zeros(batch, points, 3, device=device))
