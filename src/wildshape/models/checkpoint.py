# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The only file that knows the checkpoint format: one safetensors file (DESIGN, Checkpoint)."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from wildshape.errors import BadInputError
from wildshape.geometry.visibility import FacingBins, PixelBins, PolarBins, Projection
from wildshape.io.atomic import atomic_write
from wildshape.models.confidence import Calibration, Facts
from wildshape.models.shapepose import NetworkConfig, ShapePoseNet
from wildshape.records import SensorKind

FORMAT, VERSION = "wildshape-checkpoint", 1
_PROJECTIONS = {kind.__name__: kind for kind in (PolarBins, FacingBins, PixelBins)}


@dataclass(frozen=True)
class ModelSettings:
    """Everything besides the weights that inference needs, and where the weights come from.

    Attributes:
        network: sizes.
        sensor: how scans are centred.
        input_points: n, points a scan is resampled to.
        projection: binning of the projection term.
        beta: its weight in the label-free cost.
        facing: scans are turned towards their object first (`geometry/facing.py`).
        belief: metres of cost that a nat of the selector's belief is worth.
        extent_m: smallest and largest extent of the scans trained on, metres.
        cost_m: median and 90th percentile of the label-free cost on held-out scans, metres.
        up: canonical direction that the z axes of the LiDARs trained on have in common; None if
            they have none (`geometry/level.py`), or for cameras.
        calibration: of the confidence; None if truth never told (`models/confidence.py`).
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
    provenance: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)


def save_checkpoint(
    path: Path, network: ShapePoseNet, settings: ModelSettings, half: bool = False
) -> None:
    """Write weights and settings atomically; `half` stores float16."""
    dtype = torch.float16 if half else torch.float32
    weights = {k: v.detach().cpu().to(dtype) for k, v in network.state_dict().items()}
    described = asdict(settings)
    described["projection"]["kind"] = type(settings.projection).__name__
    metadata = {"format": FORMAT, "version": str(VERSION), "settings": json.dumps(described)}
    with atomic_write(path) as file:
        file.write(save(weights, metadata))


def load_checkpoint(path: Path) -> tuple[ShapePoseNet, ModelSettings]:
    """Network in evaluation mode, and its settings.

    Raises:
        BadInputError: no such file, no safetensors, another format or version, weights missing.
    """
    path = Path(path)
    if not path.is_file():
        raise BadInputError(f"{path}: no such checkpoint; give --model a .safetensors file.")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            weights = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError) as error:
        raise BadInputError(f"{path}: not a readable safetensors file ({error}).") from error
    network, settings = _described(path, metadata)
    _check_weights(path, network, weights)
    network.load_state_dict(weights)
    return network.eval(), settings


def _described(path: Path, metadata: dict[str, str]) -> tuple[ShapePoseNet, ModelSettings]:
    """The network, its weights not yet loaded, and the settings of the metadata."""
    found = f"{metadata.get('format', 'no format')} version {metadata.get('version', 'none')}"
    if found != f"{FORMAT} version {VERSION}":
        raise BadInputError(
            f"{path}: expected a {FORMAT} of version {VERSION}, found {found};"
            " give --model a file written by wildshape train."
        )
    try:
        settings = settings_from_dict(json.loads(metadata["settings"]))
        return ShapePoseNet(settings.network), settings
    except (KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise BadInputError(f"{path}: its settings are damaged ({error!r}).") from error


def settings_from_dict(values: dict[str, Any]) -> ModelSettings:
    """The inverse of what `save_checkpoint` writes into the metadata."""
    projection = dict(values.pop("projection"))
    kind = _PROJECTIONS[projection.pop("kind")]
    network: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v for k, v in values.pop("network").items()
    }
    for name in ("extent_m", "cost_m"):
        values[name] = tuple(values[name])
    if values.get("up") is not None:
        values["up"] = tuple(values["up"])
    values["calibration"] = _calibration(values.get("calibration"))
    return ModelSettings(network=NetworkConfig(**network), projection=kind(**projection), **values)


def _calibration(values: dict[str, Any] | None) -> Calibration | None:
    if values is None:
        return None
    found = Calibration(**{**values, "weights": tuple(values["weights"])})
    if len(found.weights) != len(Facts._fields):
        raise ValueError(f"{len(found.weights)} weights for {len(Facts._fields)} facts")
    return found


def _check_weights(path: Path, network: ShapePoseNet, weights: dict[str, torch.Tensor]) -> None:
    expected = network.state_dict()
    missing = sorted(set(expected) - set(weights))
    extra = sorted(set(weights) - set(expected))
    wrong = [k for k in expected if k in weights and expected[k].shape != weights[k].shape]
    if missing or extra or wrong:
        raise BadInputError(
            f"{path}: weights do not fit the network; missing {missing or 'none'},"
            f" unexpected {extra or 'none'}, of another shape {wrong or 'none'}."
        )
