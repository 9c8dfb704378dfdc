# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised, as a module: the loop and DistributedDataParallel know nothing else of it."""

from functools import partial
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.method.multiview import LossConfig, multiview_loss
from wildshape.method.network import Encoding, Poses, ShapePoseNet
from wildshape.training.batches.views import Batch

PROHIBITIVE_M = 100.0


class Objective(NamedTuple):
    """What a step minimises and what it logs, all on the device.

    Attributes:
        loss: with a graph.
        terms: of the loss by the names under which they are logged, without a graph, unweighted.
        winner: the branch that won, of each scan.
    """

    loss: Float[Tensor, ""]
    terms: dict[str, Tensor]
    winner: Int[Tensor, "B"]


class WeaklySupervised(nn.Module):
    """The paper's objective (eq. 5), with what holds headings together where asked."""

    def __init__(
        self, network: ShapePoseNet, config: LossConfig, encoding: Encoding | None = None
    ) -> None:
        super().__init__()
        self.network, self.config = network, config
        self.encoding: Encoding | None = encoding
        self._held = config.time_ordered or bool(config.agree_at)

    def forward(self, batch: Batch) -> Objective:
        """Loss of one batch."""
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
        loss = terms.total
        if self.config.belief > 0:
            belief = poses.log_belief.gather(1, terms.winner[:, None]).mean()
            loss = loss - self.config.belief * belief
        logged = {"observation": terms.observation, "projection": terms.projection}
        return Objective(loss, logged, terms.winner)

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


@torch.no_grad()
def turning_handicap(
    rotation: Float[Tensor, "B K 3 3"],
    turn: Float[Tensor, "B 3 3"],
    anchor: Float[Tensor, "B 3 3"],
) -> Float[Tensor, "B K"]:
    """Metres of handicap: none up to 90 degrees from the anchor, prohibitive beyond.

    Beyond the paper. Hindsight lets every scan pick whichever of two headings, a half turn apart,
    fits a near-symmetric shape a little better, so nothing ever makes the scans of a track agree:
    the paper's lottery (METHOD 12). Neighbouring scans, as recorded, do agree: their relative
    rotation is far below 90 degrees. Branches that would turn the object around cannot win.

    Args:
        rotation: `R_sensor_canonical` of every branch of the turned scans.
        turn: rotation by which each scan was turned for training (`x_turned = turn x_recorded`).
        anchor: `R_sensor_canonical` that each scan, as recorded, is held to.
    """
    recorded = turn.mT[:, None] @ rotation
    relative = anchor[:, None].mT @ recorded
    cosine = (relative.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
    return torch.where(cosine > 0, 0.0, PROHIBITIVE_M * (1 - cosine))
