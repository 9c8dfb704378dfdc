# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Loss against a known pose and a known shape: of the fused track, or the truth (the oracle)."""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from wildshape.geometry.projection.field_of_view import within_view
from wildshape.geometry.projection.visibility import FacingBins, facing_bins
from wildshape.method.observation import masked_mean
from wildshape.ops.nearest import nearest_both
from wildshape.ops.zbuffer import visible

_CELL_M, _FAR_M, _SMALLEST = 0.25, 0.4, 1e-12
_STRAYS = 0.02
_SIDES = torch.tensor([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


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
) -> PoseTerms:
    """How far the corners of the object's box lie from where they belong; hindsight's winner.

    One length in metres for rotation and translation, whatever the object's size.

    Args:
        rotation: of every branch.
        translation: of the same.
        true_rotation: the target.
        true_translation: the target.
        shapes: target shapes, canonical frame.
    """
    strays = int(_STRAYS * shapes.shape[1])
    half = shapes.abs().mT.contiguous().topk(strays + 1, dim=-1).values[..., -1]
    corners = half[:, None] * _SIDES.to(half)
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
) -> ShapeTerms:
    """Both ways of the Chamfer distance between canonical shapes.

    Args:
        shapes: predicted.
        targets: what the track showed, or the truth.
        known: predicted points about which the targets can say something (`seen_from`); None: all.
            Where the targets are of real scans, distances beyond 0.4 m say nothing either.
    """
    to_target, to_shape = nearest_both(shapes.detach(), targets)
    precision = _distance(shapes, targets, to_target.index)
    coverage = _distance(targets, shapes, to_shape.index)
    if known is None:
        return ShapeTerms(precision.mean(-1), coverage.mean(-1))
    near = masked_mean(precision.clamp_max(_FAR_M), known)
    return ShapeTerms(near, coverage.clamp_max(2 * _FAR_M).mean(-1))


def _distance(source: Tensor, target: Tensor, index: Tensor) -> Tensor:
    found = target.gather(1, index[..., None].expand(-1, -1, 3))
    return (source - found).square().sum(-1).clamp_min(_SMALLEST).sqrt()


@torch.no_grad()
def seen_from(
    shapes: Float[Tensor, "B P 3"],
    sensors: Float[Tensor, "B O 3"],
    view_top: Float[Tensor, "B"],
    mirror: bool,
) -> Bool[Tensor, "B P"]:
    """The points of canonical shapes that at least one of the sensors would see.

    Args:
        shapes: predicted, canonical frame, z up.
        sensors: places in the same frame, level.
        view_top: slope above which they see nothing.
        mirror: the object is symmetric in y = 0: what was seen of one side is known of the other.
    """
    seen = torch.zeros(shapes.shape[:2], dtype=torch.bool, device=shapes.device)
    sides = (1.0, -1.0) if mirror else (1.0,)
    for place in sensors.unbind(1):
        for side in sides:
            at = place * place.new_tensor((1.0, side, 1.0))
            rays = shapes - at[:, None]
            bins = facing_bins(rays, rays.mean(1), FacingBins(_CELL_M))
            seen |= visible(bins.index, bins.depth, bins.count) & within_view(rays, view_top)
    return seen
