# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which model and which device a command uses."""

import hashlib
from pathlib import Path

import torch

from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor, load
from wildshape.inference.shipped import weights_file


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
