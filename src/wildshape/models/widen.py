# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A wider network that gives the answers of a trained one, to train on from there.

Beyond the paper. As in Net2Net (Chen, Goodfellow and Shlens, ICLR 2016) nothing that was learned is
lost; the units that are added are drawn at random and nothing listens to them yet, so that each
learns something of its own (copies of old units would stay alike).
"""

from dataclasses import replace

import torch
from torch import Tensor, nn

from wildshape.errors import BadInputError
from wildshape.models.pcn import PCNEncoder
from wildshape.models.shapepose import NetworkConfig, ShapePoseNet


def can_widen(config: NetworkConfig, into: NetworkConfig) -> bool:
    """Whether the second differs from the first by widths alone, none of them smaller."""
    mine = (*config.encoder, *config.decoder, *config.pose)
    theirs = (*into.encoder, *into.decoder, *into.pose)
    same = replace(into, encoder=config.encoder, decoder=config.decoder, pose=config.pose) == config
    return same and config.backbone == "pcn" and all(a <= b for a, b in zip(mine, theirs))


@torch.no_grad()
def widened(network: ShapePoseNet, into: NetworkConfig) -> ShapePoseNet:
    """A network of those sizes whose answers are the given one's; draws from torch's generator.

    Raises:
        BadInputError: `into` is not a wider form of the same network, or its encoder is not PCN's.
    """
    if not can_widen(network.config, into):
        raise BadInputError(f"{into} is no wider form of {network.config}; change widths alone.")
    wide = ShapePoseNet(into)
    assert isinstance(network.encoder, PCNEncoder)
    assert isinstance(wide.encoder, PCNEncoder)
    for part, old in (
        (wide.encoder, network.encoder),
        (wide.shape, network.shape),
    ):
        for layer, known in zip(part.children(), old.children(), strict=True):
            _widen(layer, known)
    _widen(wide.pose.layer1, network.pose.layer1, groups=into.branches)
    # Weights of the branches' inner layers: (branch, in, out).
    _put(wide.pose.weight2.mT, network.pose.weight2.mT)
    _put(wide.pose.weight3.mT, network.pose.weight3.mT)
    wide.pose.bias2[..., : network.pose.bias2.shape[-1]] = network.pose.bias2
    wide.pose.bias3.copy_(network.pose.bias3)
    return wide


def _widen(layer: nn.Module, known: nn.Module, groups: int = 1) -> None:
    """A linear layer whose outputs come in `groups`, each of which is widened."""
    assert isinstance(layer, nn.Linear)
    assert isinstance(known, nn.Linear)
    _put(layer.weight.unflatten(0, (groups, -1)), known.weight.unflatten(0, (groups, -1)))
    if known.bias is not None:
        old = known.bias.unflatten(0, (groups, -1))
        layer.bias.unflatten(0, (groups, -1))[:, : old.shape[1]] = old


def _put(wide: Tensor, known: Tensor) -> None:
    """Old outputs (..., out, in) take from old inputs what they took, and nothing from new ones."""
    out, inputs = known.shape[-2:]
    wide[..., :out, :inputs] = known
    wide[..., :out, inputs:] = 0
