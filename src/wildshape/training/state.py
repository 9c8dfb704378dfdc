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
from safetensors import SafetensorError, safe_open
from torch import nn

from wildshape.errors import BadInputError
from wildshape.io.atomic import atomic_write
from wildshape.method.saved_network import check_numbers, check_shapes, check_sum, packed

_MOST_STEPS = 1 << 53
_FADED, _LOOK_EVERY = 1e-30, 100  # steps; a tenth less each, a moment stays far from 1e-38
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

    @torch.no_grad()
    def drop_faded(self) -> None:
        """Set what has faded of Adam's moments to zero, now and then; no weight is another for it.

        Of a dead unit the mean gradient shrinks below 1e-38, where numbers are rounded so coarsely
        that it never gets to zero. A CPU takes ten times as long for these.
        """
        if self.step % _LOOK_EVERY:
            return
        for moments in self.optimiser.state.values():
            for held in (moments["exp_avg"], moments["exp_avg_sq"]):
                held.masked_fill_(held.abs() < _FADED, 0.0)


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
    with atomic_write(folder / STATE, flush=True) as file:
        file.write(packed(tensors, _said(metadata), metadata))


def load_state(folder: Path, state: TrainState, identity: dict[str, str], scans: int) -> None:
    """Fill `state` from the folder.

    Raises:
        BadInputError: damaged, or written by a run with other settings, data or seed.
    """
    path = folder / STATE
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            step, found = int(metadata["step"]), dict(json.loads(metadata["identity"]))
            if not 0 <= step < _MOST_STEPS:
                raise ValueError(f"step {step}")
            _check_identity(path, found, identity)
            expected = _expected(set(file.keys()), state, scans)
            check_shapes(path, file, expected)
            tensors = {name: file.get_tensor(name) for name in expected}
    except BadInputError:
        raise
    except (SafetensorError, OSError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise BadInputError(
            f"{path}: cannot be resumed from ({error!r}); choose a new --out."
        ) from error
    check_numbers(path, tensors)
    check_sum(path, tensors, _said(metadata), metadata)
    for name, network in (("network.", state.network), ("mean.", state.mean)):
        network.load_state_dict(_under(tensors, name))
    described = state.optimiser.state_dict()
    for index in range(len(described["param_groups"][0]["params"])):
        moments = _under(tensors, f"adam.{index}.")
        if moments:
            described["state"][index] = moments
    state.optimiser.load_state_dict(described)
    state.step, state.anchors = step, tensors.get("anchors")


def _said(metadata: dict[str, str]) -> str:
    """What is summed with the tensors."""
    return metadata["step"] + metadata["identity"]


def _expected(found: set[str], state: TrainState, scans: int) -> dict[str, torch.Tensor]:
    """Tensors of the shapes that a file with these names should hold."""
    expected = {f"network.{k}": v for k, v in state.network.state_dict().items()}
    expected |= {f"mean.{k}": v for k, v in state.mean.state_dict().items()}
    parameters = [p for group in state.optimiser.param_groups for p in group["params"]]
    for index, parameter in enumerate(parameters):
        moments = {"exp_avg": parameter, "exp_avg_sq": parameter, "step": torch.zeros(())}
        named = {f"adam.{index}.{name}": moment for name, moment in moments.items()}
        if found & named.keys():  # what was never stepped has none
            expected |= named
    if "anchors" in found:
        expected["anchors"] = torch.empty(scans, 3, 3, device="meta")
    return expected


def _under(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}


def _check_identity(path: Path, found: dict[str, str], expected: dict[str, str]) -> None:
    """What either lacks counts as empty."""
    keys = {**expected, **found}
    different = [k for k in keys if found.get(k, "") != expected.get(k, "")]
    if different:
        raise BadInputError(
            f"{path}: was written by a run with other {' and '.join(different)};"
            " resume with the same settings, data and seed, or choose a new --out."
        )
