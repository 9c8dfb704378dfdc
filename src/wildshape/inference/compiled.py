# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A network compiled by torch (docs/performance.md)."""

import warnings
from collections.abc import Callable
from copy import deepcopy
from typing import Any

import torch
from torch import nn

from wildshape.method.network import ShapePoseNet
from wildshape.ops.device import plain_torch

_BATCHES = (1, 2)  # torch compiles a batch of one by itself, and all others together


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


@plain_torch()
def _rehearse(network: nn.Module, points: int) -> None:
    device = next(network.parameters()).device
    for batch in _BATCHES:
        network(torch.zeros(batch, points, 3, device=device))
