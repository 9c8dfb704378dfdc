# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `--resume` needs, written atomically: weights, optimiser, mean weights, step.

Batches depend on (seed, step) alone, so there is no random state to keep.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save
from torch import nn

from wildshape.errors import BadInputError
from wildshape.io.atomic import atomic_write

STATE = "state.safetensors"
Net = TypeVar("Net", bound=nn.Module)


@dataclass
class TrainState(Generic[Net]):
    """Network, its running mean, the optimiser, how many steps are done, and agreed headings."""

    network: Net
    mean: Net
    optimiser: torch.optim.Adam
    step: int = 0
    anchors: torch.Tensor | None = None


def save_state(folder: Path, state: TrainState, identity: dict[str, str]) -> None:
    """Write the state; `identity` says which run it belongs to."""
    tensors = {f"network.{k}": v for k, v in state.network.state_dict().items()}
    tensors |= {f"mean.{k}": v for k, v in state.mean.state_dict().items()}
    for index, moments in state.optimiser.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{k}": torch.as_tensor(v) for k, v in moments.items()}
    if state.anchors is not None:
        tensors["anchors"] = state.anchors
    tensors = {k: v.detach().cpu().contiguous() for k, v in tensors.items()}
    metadata = {"step": str(state.step), "identity": json.dumps(identity)}
    with atomic_write(folder / STATE) as file:
        file.write(save(tensors, metadata))


def load_state(folder: Path, state: TrainState, identity: dict[str, str]) -> None:
    """Fill `state` from the folder.

    Raises:
        BadInputError: damaged, or written by a run with other settings, data or seed.
    """
    from safetensors import safe_open

    path = folder / STATE
    try:
        tensors = load_file(path)
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
        step, found = int(metadata["step"]), dict(json.loads(metadata["identity"]))
    except (SafetensorError, OSError, KeyError, TypeError, ValueError) as error:
        raise BadInputError(
            f"{path}: cannot be resumed from ({error!r}); choose a new --out."
        ) from error
    _check_identity(path, found, identity)
    for name, network in (("network.", state.network), ("mean.", state.mean)):
        network.load_state_dict(_under(tensors, name))
    described = state.optimiser.state_dict()
    for index in range(len(described["param_groups"][0]["params"])):
        moments = _under(tensors, f"adam.{index}.")
        if moments:
            described["state"][index] = moments
    state.optimiser.load_state_dict(described)
    state.step, state.anchors = step, tensors.get("anchors")


def _under(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _check_identity(path: Path, found: dict[str, str], expected: dict[str, str]) -> None:
    different = [k for k in expected if found.get(k, "") != expected[k]]
    if different:
        raise BadInputError(
            f"{path}: was written by a run with another {' and '.join(different)};"
            " resume with the same settings, data and seed, or choose a new --out."
        )
