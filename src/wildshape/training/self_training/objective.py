# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised when poses and shapes are known: from fused tracks, or from truth (oracle)."""

from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.method.multiview import LossConfig
from wildshape.method.network import Encoding, ShapePoseNet
from wildshape.training.batches.fused import FusedBatch
from wildshape.training.objectives import Objective, template_deviation
from wildshape.training.self_training.loss import pose_terms, seen_from, shape_terms

_BELIEF = 0.1


class SelfTaught(nn.Module):
    """Each scan is taught its pose and its track's shape; hindsight chooses the branch.

    Args:
        network: is taught.
        config: `template_end` is the weight of the template.
        complete: the target shapes are whole; else only what the sensors saw is taught.
        encoding: how the network encodes (see there).
        unit: metres of the unit in which losses are taken (`unit_of`).
    """

    def __init__(
        self,
        network: ShapePoseNet,
        config: LossConfig,
        complete: bool,
        encoding: Encoding | None = None,
        unit: float = 1.0,
    ) -> None:
        super().__init__()
        self.network, self.config = network, config
        self.complete, self.unit = complete, unit
        self.encoding: Encoding | None = encoding

    def forward(self, batch: FusedBatch, template: float | Tensor) -> Objective:  # noqa: ARG002
        """Loss of one batch; the weight of the template does not change from step to step."""
        code = self.network.encode(batch.scans, self.encoding)
        with record_function("wildshape: heads"):
            poses, shapes = self.network.poses(code), self.network.canonical(code) / self.unit
        translation, batch = poses.translation / self.unit, self._in_units(batch)
        pose = pose_terms(
            poses.rotation, translation, batch.rotation, batch.translation, batch.shapes
        )
        belief = poses.log_belief.gather(1, pose.winner[:, None]).mean()
        shape = shape_terms(shapes, batch.shapes, self._known(shapes, batch))
        deviation = template_deviation(shapes)
        precision, coverage, distance = (
            part.mean() for part in (shape.precision, shape.coverage, pose.distance)
        )
        loss = distance + precision + coverage - _BELIEF * belief
        loss = loss + self.config.template_end * deviation
        lengths = {
            "pose": distance,
            "coverage": coverage,
            "precision": precision,
            "template": deviation,
        }
        metres = {name: self.unit * part.detach() for name, part in lengths.items()}
        return Objective(loss, metres, pose.winner)

    def _in_units(self, batch: FusedBatch) -> FusedBatch:
        """Targets in units instead of metres; scans as they are."""
        if self.unit == 1.0:
            return batch
        lengths = (batch.translation, batch.shapes, batch.sensors)
        translation, shapes, sensors = (part / self.unit for part in lengths)
        return batch._replace(translation=translation, shapes=shapes, sensors=sensors)

    def _known(self, shapes: Tensor, batch: FusedBatch) -> Tensor | None:
        """The points that some of the track's views would see; others may be as they like."""
        if self.complete:
            return None
        mirror = self.network.config.mirror
        return seen_from(shapes.detach(), batch.sensors, batch.view_top, mirror)
