# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised, as a module: the loop and DistributedDataParallel know nothing else of it."""

from functools import partial
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.method.multiview import LossConfig, multiview_loss
from wildshape.method.network import Encoding, Poses, ShapePoseNet
from wildshape.training.batches.views import Batch
from wildshape.training.heading_continuity import turning_handicap
from wildshape.training.template import template_deviation


class Objective(NamedTuple):
    """A loss with a graph and what is worth logging, all on the device."""

    loss: Tensor
    observation: Tensor
    projection: Tensor
    template: Tensor
    winner: Tensor


class WeaklySupervised(nn.Module):
    """The paper's objective (eq. 5), with the pull to a shared template where asked."""

    def __init__(
        self, network: ShapePoseNet, config: LossConfig, encoding: Encoding | None = None
    ) -> None:
        super().__init__()
        self.network, self.config = network, config
        self.encoding: Encoding | None = encoding
        self._held = config.time_ordered or bool(config.agree_at)

    def forward(self, batch: Batch, template: float | Tensor) -> Objective:
        """Loss of one batch; `template` is this step's weight of the template pull."""
        code = self.network.encode(batch.scans, self.encoding)
        with record_function("wildshape: heads"):
            poses = self.network.poses(code)
            shapes = self.network.canonical(code.index_select(0, batch.reference))
        terms = multiview_loss(
            batch.scans,
            batch.centres,
            shapes,
            poses.rotation,
            poses.translation,
            self.config,
            partial(self._handicap, batch, poses) if self._held else None,
        )
        deviation = template_deviation(shapes)
        loss = terms.total
        if self.config.template > 0:
            loss = loss + template * deviation
        if self.config.belief > 0:
            belief = poses.log_belief.gather(1, terms.winner[:, None]).mean()
            loss = loss - self.config.belief * belief
        return Objective(
            loss, terms.observation, terms.projection, deviation.detach(), terms.winner
        )

    def _handicap(
        self, batch: Batch, poses: Poses, cost: Float[Tensor, "B K"]
    ) -> Float[Tensor, "B K"]:
        """What keeps a track from turning around between its scans, or from what was agreed on."""
        agreed = batch.anchor.any(-1).any(-1)
        if not self.config.time_ordered:
            held = turning_handicap(poses.rotation, batch.turn, batch.anchor)
            return torch.where(agreed[:, None], held, torch.zeros_like(held))
        believed = cost - self.config.belief * poses.log_belief
        own = own_anchor(batch, poses.rotation, believed)
        anchor = torch.where(agreed[:, None, None], batch.anchor, own)
        return turning_handicap(poses.rotation, batch.turn, anchor)


def own_anchor(
    batch: Batch, rotation: Float[Tensor, "B K 3 3"], cost: Float[Tensor, "B K"]
) -> Float[Tensor, "B 3 3"]:
    """The reference scan's own pose, as recorded, for every scan of its track.

    The reference scan is one of its track's views and is posed with its own shape, so the costs of
    its branches are among those of the batch.
    """
    at = batch.reference
    branch = cost[at].argmin(-1)
    anchor = batch.turn[at].mT @ rotation[at, branch]
    return anchor.repeat_interleave(len(batch.scans) // len(at), dim=0)
