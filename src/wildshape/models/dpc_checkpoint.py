# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A trained DPC as one safetensors file, and how it is told from one of ours."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from wildshape.errors import BadInputError
from wildshape.geometry.viewing_volume import PinholeVolume, PolarVolume
from wildshape.io.atomic import atomic_write
from wildshape.models.dpc import DpcConfig, DpcNet

FORMAT, VERSION = "wildshape-dpc", 1
_VOLUMES = {kind.__name__: kind for kind in (PinholeVolume, PolarVolume)}


@dataclass(frozen=True)
class DpcSettings:
    """What a table says of a trained DPC.

    Attributes:
        network: sizes, and the sensor.
        name: of its preset.
        depth: weight of the depth image in training; 0: silhouettes alone.
        provenance: command, commit, data, hardware, seed, steps.
        half_turn: whether half turns were tried beside the best candidate in training.
    """

    network: DpcConfig
    name: str = "dpc"
    depth: float = 0.0
    provenance: dict[str, Any] = field(default_factory=dict)
    half_turn: bool = False


def is_dpc(path: Path) -> bool:
    """Whether a file is a trained DPC."""
    try:
        with safe_open(path, framework="pt") as file:
            return (file.metadata() or {}).get("format") == FORMAT
    except (SafetensorError, OSError, ValueError):
        return False


def save_dpc(path: Path, network: DpcNet, settings: DpcSettings) -> None:
    """Write weights and settings atomically."""
    weights = {k: v.detach().cpu().contiguous() for k, v in network.state_dict().items()}
    described = asdict(settings)
    described["network"]["volume"]["kind"] = type(settings.network.volume).__name__
    metadata = {"format": FORMAT, "version": str(VERSION), "settings": json.dumps(described)}
    with atomic_write(path) as file:
        file.write(save(weights, metadata))


def load_dpc(path: Path) -> tuple[DpcNet, DpcSettings]:
    """Network in evaluation mode, and its settings.

    Raises:
        BadInputError: no such file, another format or version, damaged.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        found = f"{metadata.get('format', 'no format')} version {metadata.get('version', 'none')}"
        if found != f"{FORMAT} version {VERSION}":
            raise BadInputError(
                f"{path}: expected a {FORMAT} of version {VERSION}, found {found}; train it with"
                " wildshape train --preset dpc."
            )
        settings = _settings(json.loads(metadata["settings"]))
        network = DpcNet(settings.network)
        network.load_state_dict(weights)
    except (SafetensorError, OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"{path}: not a readable trained DPC ({error!r}).") from error
    return network.eval(), settings


def _settings(values: dict[str, Any]) -> DpcSettings:
    network = dict(values.pop("network"))
    volume = dict(network.pop("volume"))
    kind = _VOLUMES[volume.pop("kind")]
    return DpcSettings(DpcConfig(volume=kind(**volume), **network), **values)
