# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Checkpoints: where they lie, and their format, one safetensors file (docs/formats.md).

No other module knows either.
"""

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import torch

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.geometry.box import unit_of
from wildshape.geometry.projection.visibility import Projection
from wildshape.io.atomic import atomic_write
from wildshape.io.guard import record_of
from wildshape.method.confidence import Calibration, ConfidenceFeatures
from wildshape.method.network import NetworkConfig, ShapePoseNet
from wildshape.method.saved_network import Format, load_network, packed_network
from wildshape.method.trust import Trust
from wildshape.records import SensorKind

MODEL = "model.safetensors"
"""The checkpoint in the folder of a training run."""

_WEIGHTS = Path(__file__).parent.parent / "weights"
SHIPPED = _WEIGHTS / "default.safetensors"
FORMAT, VERSION = "wildshape-checkpoint", 1
_UNIT_WITHIN = 0.01
_WIDTH = (1.0, 2.0**16)
_BOUNDS = {
    "network.encoder": _WIDTH,
    "network.decoder": _WIDTH,
    "network.pose": _WIDTH,
    "network.points": (1.0, 2.0**20),
    "network.branches": (1.0, 2.0**10),
    "network.start": (0.0, 1e3),
    "network.scale": (1e-3, 1e4),
    "network.neighbours": (1.0, 2.0**10),
    "network.centres": (1.0, 2.0**16),
    "network.rays.count": (1.0, 2.0**16),
    "network.rays.widths": _WIDTH,
    "network.rays.depth_m": (1e-3, 1e4),
    "network.rays.within_m": (1e-3, 1e4),
    "input_points": (1.0, 2.0**16),
    "projection.d_azimuth": (1e-3, math.pi),
    "projection.d_pitch": (1e-3, math.pi),
    "projection.cell_m": (1e-3, 1e3),
    "projection.cell": (1e-4, 1e2),
    "beta": (0.0, 1e3),
    "belief": (0.0, 1e3),
    "extent_m": (0.0, math.inf),
    "cost_m": (0.0, 1e6),
    "calibration.weights": (-1e3, 1e3),
    "calibration.bias": (-1e3, 1e3),
    "calibration.sigma": (1e-6, 1e3),
    "calibration.within_m": (1e-6, 1e3),
}
"""Of numbers in the settings: wide of all that was ever trained, and safe to compute with."""


@dataclass(frozen=True)
class ModelSettings:
    """Everything besides the weights that inference needs, and where the weights come from.

    Attributes:
        sensor: how scans are centred.
        input_points: n, points a scan is resampled to.
        projection: binning of the projection term.
        beta: its weight in the label-free cost.
        facing: scans are turned towards their object first (`line_of_sight.py`).
        belief: metres of cost that a nat of the selector's belief is worth.
        extent_m: smallest and largest extent of the scans trained on, metres.
        cost_m: median and 90th percentile of the label-free cost on held-out scans, metres.
        up: canonical direction that the z axes of the LiDARs trained on have in common; None if
            they have none (`geometry/gravity.py`), or for cameras.
        calibration: of the Chamfer distance; None if truth never told (`confidence.py`).
        trust: probabilities of heading, box and kind; None where they were not fitted (`trust.py`).
        provenance: command, commit, data, hardware, seed, steps.
        metrics: held-out figures.
    """

    network: NetworkConfig
    sensor: SensorKind
    input_points: int
    projection: Projection
    beta: float
    facing: bool = False
    belief: float = 0.0
    extent_m: tuple[float, float] = (0.0, float("inf"))
    cost_m: tuple[float, float] = (0.1, 0.2)
    up: tuple[float, float, float] | None = None
    calibration: Calibration | None = None
    trust: Trust | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)

    @property
    def unit(self) -> float:
        """Metres of the unit in which such objects are as large as vehicles (`unit_of`)."""
        return unit_of(self.extent_m[1])


def weights_file(model: str | Path | None) -> Path:
    """The checkpoint meant: a file, a run's folder, shipped weights by name, or the default ones.

    What exists goes before a name.

    Raises:
        BadInputError: none of these; names the weights that are shipped.
    """
    if not isinstance(model, str | PathLike | None):
        raise BadInputError(f"model: expected a path or a name, found {model!r}.")
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


def save_checkpoint(
    path: Path | str, network: ShapePoseNet, settings: ModelSettings, half: bool = False
) -> None:
    """Write weights and settings atomically; `half` stores float16."""
    path = as_path(path, "path")
    dtype = torch.float16 if half else torch.float32
    weights = {k: v.detach().cpu().to(dtype) for k, v in network.state_dict().items()}
    described = asdict(settings)
    described["projection"]["kind"] = type(settings.projection).__name__
    metadata = {"format": FORMAT, "version": str(VERSION), "settings": json.dumps(described)}
    with atomic_write(path, flush=True) as file:
        file.write(packed_network(weights, metadata))


def load_checkpoint(path: Path | str) -> tuple[ShapePoseNet, ModelSettings]:
    """Network in evaluation mode, and its settings.

    Raises:
        BadInputError: no such file, no safetensors, another format or version, damaged settings,
            weights missing, of another shape or no numbers.
    """
    return load_network(as_path(path, "path"), _FORMAT)


def settings_from_dict(values: object) -> ModelSettings:
    """The inverse of what `save_checkpoint` writes into the metadata.

    Raises:
        ValueError: a value is missing, unknown, of another type or out of its bounds.
    """
    settings = record_of(ModelSettings, values, _BOUNDS)
    for name, (low, high) in (("extent_m", settings.extent_m), ("cost_m", settings.cost_m)):
        if not (low <= high and high > 0):
            raise ValueError(f"{name} is {low:g}, {high:g}, expected a smaller and a larger number")
    if settings.up is not None and abs(math.hypot(*settings.up) - 1) > _UNIT_WITHIN:
        raise ValueError(f"up is {settings.up}, expected a direction of length 1")
    known = settings.calibration
    if known is not None and len(known.weights) != len(ConfidenceFeatures._fields):
        raise ValueError(
            f"{len(known.weights)} weights for {len(ConfidenceFeatures._fields)} features"
        )
    if settings.trust is not None:
        settings.trust.check()
    return settings


_SOURCE = "name a file that wildshape train wrote (those of its dpc presets are for evaluate alone)"
_FORMAT = Format(FORMAT, VERSION, _SOURCE, settings_from_dict, lambda s: ShapePoseNet(s.network))
