# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is minimised when poses and shapes are known: from fused tracks, or from truth (oracle)."""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.geometry.projection.field_of_view import within_view
from wildshape.geometry.projection.visibility import FacingBins, facing_bins
from wildshape.method.network import Encoding, ShapePoseNet
from wildshape.method.observation import masked_mean
from wildshape.ops.nearest import nearest_both, nearest_distance
from wildshape.ops.zbuffer import visible
from wildshape.training.batches.fused import FusedBatch
from wildshape.training.objectives import Objective

_SMALLEST = 1e-12
_SIDES = torch.tensor([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@dataclass(frozen=True)
class TaughtLossConfig:
    """How far a network is from what it is taught. Lengths are for vehicles.

    Attributes:
        pose: weight of the pose beside the shape; 0 teaches no pose, as the paper's oracle has it.
        belief: weight of the cross-entropy that teaches the selector the winner.
        cell_m: bins in which nearer points of a shape hide others from a sensor.
        far_m: farther apart, real scans say nothing; coverage counts up to twice as far.
        strays: share of a target's points beyond its box on each axis.
    """

    pose: float = 1.0
    belief: float = 0.3
    cell_m: float = 0.25
    far_m: float = 0.4
    strays: float = 0.02


_DEFAULT = TaughtLossConfig()


class SelfTaught(nn.Module):
    """Each scan is taught its pose and its track's shape; hindsight chooses the branch.

    Args:
        network: is taught.
        complete: the target shapes are whole; else only what the sensors saw is taught.
        encoding: how the network encodes (see there).
        unit: metres of the unit in which losses are taken (`unit_of`).
        distances: what counts as far.
    """

    sides: Tensor

    def __init__(
        self,
        network: ShapePoseNet,
        complete: bool,
        encoding: Encoding | None = None,
        unit: float = 1.0,
        distances: TaughtLossConfig = _DEFAULT,
    ) -> None:
        super().__init__()
        self.network = network
        self.complete, self.unit, self.distances = complete, unit, distances
        self.encoding: Encoding | None = encoding
        sides = _SIDES.to(next(network.parameters()).device)  # a recorded step may not copy it
        self.register_buffer("sides", sides, persistent=False)

    def forward(self, batch: FusedBatch) -> Objective:
        """Loss of one batch."""
        code = self.network.encode(batch.scans, self.encoding, batch.rays)
        with record_function("wildshape: heads"):
            poses, shapes = self.network.poses(code), self.network.canonical(code) / self.unit
        translation, batch = poses.translation / self.unit, self._in_units(batch)
        pose = pose_terms(
            poses.rotation,
            translation,
            batch.rotation,
            batch.translation,
            batch.shapes,
            self.distances,
            self.sides,
        )
        belief = poses.log_belief.gather(1, pose.winner[:, None]).mean()
        known = self._known(shapes, batch)
        if self._halved:
            shape = shape_terms(*one_side(shapes, batch.shapes, known), self.distances)
        else:
            shape = shape_terms(shapes, batch.shapes, known, self.distances)
        precision, coverage, distance = (
            part.mean() for part in (shape.precision, shape.coverage, pose.distance)
        )
        rules = self.distances
        loss = rules.pose * distance + precision + coverage - rules.belief * belief
        lengths = {"pose": distance, "coverage": coverage, "precision": precision}
        metres = {name: self.unit * part.detach() for name, part in lengths.items()}
        return Objective(loss, metres, pose.winner)

    @property
    def _halved(self) -> bool:
        """Shapes are reflected halves, and so are fused targets: one side stands for both."""
        return self.network.config.mirror and not self.complete

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
        return seen_from(shapes.detach(), batch.sensors, batch.view_top, mirror, self.distances)


class PoseTerms(NamedTuple):
    """Loss of the poses.

    Attributes:
        distance: of the winning branch, a scan each, metres.
        winner: that branch.
    """

    distance: Float[Tensor, "B"]
    winner: Int[Tensor, "B"]


def pose_terms(
    rotation: Float[Tensor, "B K 3 3"],
    translation: Float[Tensor, "B K 3"],
    true_rotation: Float[Tensor, "B 3 3"],
    true_translation: Float[Tensor, "B 3"],
    shapes: Float[Tensor, "B G 3"],
    config: TaughtLossConfig = _DEFAULT,
    sides: Float[Tensor, "8 3"] = _SIDES,
) -> PoseTerms:
    """How far the corners of the object's box lie from where they belong; hindsight's winner.

    One length in metres for rotation and translation, whatever the object's size.

    Args:
        rotation: of every branch.
        translation: of the same.
        true_rotation: the target.
        true_translation: the target.
        shapes: target shapes, canonical frame.
        config: how many of a shape's points are strays.
        sides: of the box's corners, +1 or -1 on each axis; on the device of the others.
    """
    strays = int(config.strays * shapes.shape[1])
    half = shapes.abs().mT.contiguous().topk(strays + 1, dim=-1).values[..., -1]
    corners = half[:, None] * sides
    posed = corners[:, None] @ rotation.mT + translation[:, :, None]
    true = corners @ true_rotation.mT + true_translation[:, None]
    distance = (posed - true[:, None]).square().sum(-1).clamp_min(_SMALLEST).sqrt().mean(-1)
    winner = distance.detach().argmin(-1)
    return PoseTerms(distance.gather(1, winner[:, None])[:, 0], winner)


class ShapeTerms(NamedTuple):
    """Loss of the shapes, metres, an object each.

    Attributes:
        precision: predicted points to the target.
        coverage: target points to the prediction.
    """

    precision: Float[Tensor, "B"]
    coverage: Float[Tensor, "B"]


def shape_terms(
    shapes: Float[Tensor, "B P 3"],
    targets: Float[Tensor, "B G 3"],
    known: Bool[Tensor, "B P"] | None,
    config: TaughtLossConfig = _DEFAULT,
) -> ShapeTerms:
    """Both ways of the Chamfer distance between canonical shapes.

    Args:
        shapes: predicted.
        targets: what the track showed, or the truth.
        known: predicted points about which the targets can say something (`seen_from`); None: all.
            Where the targets are of real scans, far distances say nothing either.
        config: what is far.
    """
    to_target, to_shape = nearest_both(shapes.detach(), targets)
    precision = nearest_distance(shapes, targets, to_target)
    coverage = nearest_distance(targets, shapes, to_shape)
    if known is None:
        return ShapeTerms(precision.mean(-1), coverage.mean(-1))
    near = masked_mean(precision.clamp_max(config.far_m), known)
    return ShapeTerms(near, coverage.clamp_max(2 * config.far_m).mean(-1))


def one_side(
    shapes: Float[Tensor, "B P 3"],
    targets: Float[Tensor, "B G 3"],
    known: Bool[Tensor, "B P"] | None,
) -> tuple[Float[Tensor, "B Q 3"], Float[Tensor, "B G 3"], Bool[Tensor, "B Q"] | None]:
    """What `shape_terms` takes, on the side y > 0: the same terms for half of the search.

    Where both clouds are symmetric in y = 0, the nearest point of a point on that side is on that
    side, too. Targets are drawn from symmetric clouds; reflected onto one side they lie twice as
    dense.

    Args:
        shapes: predicted; the second half of the points is the reflection of the first.
        targets: of symmetric objects.
        known: as of `shape_terms`, the same on both sides.
    """
    half = shapes.shape[1] // 2
    (x, y, z), (u, v, w) = shapes[:, :half].unbind(-1), targets.unbind(-1)
    ours, theirs = torch.stack((x, y.abs(), z), dim=-1), torch.stack((u, v.abs(), w), dim=-1)
    return ours, theirs, None if known is None else known[:, :half]


@torch.no_grad()
def seen_from(
    shapes: Float[Tensor, "B P 3"],
    sensors: Float[Tensor, "B O 3"],
    view_top: Float[Tensor, "B"],
    mirror: bool,
    config: TaughtLossConfig = _DEFAULT,
) -> Bool[Tensor, "B P"]:
    """The points of canonical shapes that at least one of the sensors would see.

    Args:
        shapes: predicted, canonical frame, z up.
        sensors: places in the same frame, level.
        view_top: slope above which they see nothing.
        mirror: the second half of the points is the reflection of the first in y = 0: what was
            seen of one side is known of the other.
        config: in which bins points hide others.
    """
    seen = torch.zeros(shapes.shape[:2], dtype=torch.bool, device=shapes.device)
    shapes = shapes.mT.contiguous().mT  # as `facing_bins` has them in memory
    for place in sensors.unbind(1):
        rays = shapes - place[:, None]
        bins = facing_bins(rays, rays.mean(1), FacingBins(config.cell_m))
        seen |= visible(bins.index, bins.depth, bins.count) & within_view(rays, view_top)
    return seen | seen.roll(shapes.shape[1] // 2, 1) if mirror else seen
