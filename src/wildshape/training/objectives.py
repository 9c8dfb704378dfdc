# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised, as a module: the loop and DistributedDataParallel know nothing else of it."""

from typing import NamedTuple

from torch import Tensor, nn

from wildshape.datasets.views import Batch
from wildshape.losses.multiview import LossConfig, multiview_loss
from wildshape.losses.template import template_deviation
from wildshape.models.shapepose import ShapePoseNet


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
        poses = self.network.poses(code)
        shapes = self.network.canonical(code[batch.reference])
        terms = multiview_loss(
            batch.scans, batch.centres, shapes, poses.rotation, poses.translation, self.config
        )
        deviation = template_deviation(shapes)
        loss = terms.total + template * deviation if template > 0 else terms.total
        return Objective(
            loss, terms.observation, terms.projection, deviation.detach(), terms.winner
        )
