# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A trained DPC as one safetensors file, and how it is told from one of ours."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.io.atomic import atomic_write
from wildshape.io.guard import record_of
from wildshape.method.saved_network import Format, load_network, packed_network

FORMAT, VERSION = "wildshape-dpc", 1
_LENGTH = (1e-3, 1e3)
_BOUNDS = {
    "network.image": (8.0, 2.0**10),
    "network.voxels": (1.0, 2.0**8),
    "network.points": (1.0, 2.0**20),
    "network.channels": (1.0, 2.0**10),
    "network.code": (1.0, 2.0**16),
    "network.candidates": (1.0, 2.0**10),
    "network.reach": (0.0, 1e3),
    "network.volume.distance": _LENGTH,
    "network.volume.focal": _LENGTH,
    "network.volume.scale": _LENGTH,
    "depth": (0.0, 1e6),
}


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
    with atomic_write(path, flush=True) as file:
        file.write(packed_network(weights, metadata))


def load_dpc(path: Path) -> tuple[DpcNet, DpcSettings]:
    """Network in evaluation mode, and its settings.

    Raises:
        BadInputError: no such file, another format or version, damaged.
    """
    return load_network(Path(path), _FORMAT)


def _settings(values: object) -> DpcSettings:
    settings = record_of(DpcSettings, values, _BOUNDS)
    image, voxels = settings.network.image, settings.network.voxels
    if image.bit_count() != 1 or image % voxels:
        raise ValueError(f"an image of {image} and {voxels} voxels are no power of 2 and its part")
    return settings


_SOURCE = "train it with wildshape train --preset dpc"
_FORMAT = Format(FORMAT, VERSION, _SOURCE, _settings, lambda s: DpcNet(s.network))
