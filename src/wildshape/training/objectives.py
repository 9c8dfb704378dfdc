# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised, as a module: the loop and DistributedDataParallel know nothing else of it."""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.datasets.views import Batch
from wildshape.losses.hindsight import score_hypotheses
from wildshape.losses.multiview import LossConfig, multiview_loss
from wildshape.losses.steady import turning_handicap
from wildshape.losses.template import template_deviation
from wildshape.models.shapepose import Poses, ShapePoseNet


class Objective(NamedTuple):
    """A loss with a graph and what is worth logging, all on the device."""

    loss: Tensor
    observation: Tensor
    projection: Tensor
    template: Tensor
    winner: Tensor


class WeaklySupervised(nn.Module):
    """The paper's objective (eq. 5), with the pull to a shared template where asked."""

    def __init__(self, network: ShapePoseNet, config: LossConfig) -> None:
        super().__init__()
        self.network, self.config = network, config

    def forward(self, batch: Batch, template: float) -> Objective:
        """Loss of one batch; `template` is this step's weight of the template pull."""
        code = self.network.encode(batch.scans)
        with record_function("wildshape: heads"):
            poses = self.network.poses(code)
            shapes = self.network.canonical(code[batch.reference])
        terms = multiview_loss(
            batch.scans,
            batch.centres,
            shapes,
            poses.rotation,
            poses.translation,
            self.config,
            self._handicap(batch, shapes, poses),
        )
        deviation = template_deviation(shapes)
        loss = terms.total
        if template > 0:
            loss = loss + template * deviation
        if self.config.belief > 0:
            belief = poses.log_belief.gather(1, terms.winner[:, None]).mean()
            loss = loss - self.config.belief * belief
        return Objective(
            loss, terms.observation, terms.projection, deviation.detach(), terms.winner
        )

    @torch.no_grad()
    def _handicap(self, batch: Batch, shapes: Tensor, poses: Poses) -> Tensor | None:
        """What keeps branches from winning besides their cost: belief, and turning around."""
        config = self.config
        if not config.steady:
            return None
        anchor = batch.anchor if batch.anchor is not None else self._anchor(batch, shapes, poses)
        return turning_handicap(poses.rotation, batch.turn, anchor)

    def _anchor(self, batch: Batch, shapes: Tensor, poses: Poses) -> Tensor:
        """The reference scan's own pose, as recorded, for every scan of its track."""
        config, at = self.config, batch.reference
        own = Poses(*(part[at] for part in poses))
        scores = score_hypotheses(
            batch.scans[at], batch.centres[at], own.apply(shapes), config.projection
        )
        branch = (scores.cost(config.beta) - config.belief * own.log_belief).argmin(-1)
        anchor = batch.turn[at].mT @ own.choose(branch).rotation[:, 0]
        return anchor.repeat_interleave(len(batch.scans) // len(at), dim=0)
