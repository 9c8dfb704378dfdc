# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which model and which device a command uses."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import torch

from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor, load
from wildshape.inference.shipped_weights import weights_file

if TYPE_CHECKING:
    from wildshape.baselines.dpc.completer import Dpc

OURS = "wildshape"


def model_file(model: Path | None) -> Path:
    """The checkpoint meant: a file, that of a run's folder, or a shipped one, by name or not."""
    if model is None or not model.is_dir():
        return weights_file(model)
    from wildshape.training.loop import MODEL  # the trainer only where a run's folder is named

    return model / MODEL


def load_model(model: Path | None, device: str = "auto", *, raw: bool = False) -> Predictor:
    """The predictor; `raw`: the network's own answers, not refined against the scan.

    Raises:
        BadInputError: no such checkpoint, or none that can be used.
    """
    return load(model_file(model), choose_device(device), raw=raw)


def load_models(
    models: Sequence[Path], device: str, *, raw: bool = False
) -> "dict[str, Predictor | Dpc]":
    """Models by the name of their row, ours or DPC's; the shipped weights if none is named.

    Raises:
        BadInputError: a checkpoint that cannot be used, two of one name, or a baseline's name.
    """
    from wildshape.baselines.named import NAMES
    from wildshape.training.loop import MODEL

    if not models:
        return {OURS: load_model(None, device, raw=raw)}
    found: dict[str, Predictor | Dpc] = {}
    for model in models:
        file = model_file(model)
        name = file.resolve().parent.name if file.name == MODEL else file.stem
        if name in found:
            raise BadInputError(f"{model}: another --model is called {name} too; rename one.")
        if name in NAMES:
            raise BadInputError(f"{model}: {name} is the name of a baseline; rename the model.")
        found[name] = _dpc(file, device) or load_model(model, device, raw=raw)
    return found


def _dpc(file: Path, device: str) -> "Dpc | None":
    """The trained DPC in a file, if it is one."""
    from wildshape.baselines.dpc import completer as dpc
    from wildshape.baselines.dpc.checkpoint import is_dpc

    return dpc.load(file, choose_device(device)) if is_dpc(file) else None


def fingerprint(model: Path | None) -> str:
    """Short hash of the checkpoint's bytes; empty if there is no such file."""
    path = model_file(model)
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def choose_device(device: str) -> str:
    """`cpu` or `cuda`.

    Raises:
        BadInputError: a GPU is asked for, and torch finds none.
    """
    found = torch.cuda.is_available()
    if device == "cuda" and not found:
        raise BadInputError("--device cuda: torch finds no GPU here; use --device cpu.")
    return "cuda" if found and device != "cpu" else "cpu"
