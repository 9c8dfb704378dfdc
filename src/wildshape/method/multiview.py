# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Multi-view consistency with hindsight (paper eq. 5, METHOD 6)."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from wildshape.geometry.projection.image_plane import compared
from wildshape.geometry.projection.visibility import PolarBins, Projection
from wildshape.method.hindsight import Scores, score_hypotheses
from wildshape.method.observation import observation_term, projection_term

Hindsight = Literal["scan", "track", "batch"]


@dataclass(frozen=True)
class LossConfig:
    """Weights of the loss; the defaults are the paper's for LiDAR.

    Attributes:
        beta: weight of the projection term.
        projection: how the sensor's image is binned; if it is `flat`, both terms are of points in
            the image (the paper's losses on 2D projections).
        belief: weight of the cross-entropy that teaches the selector the winner; also the metres
            of cost that a nat of belief is worth when a branch is chosen.
        time_ordered: an object does not turn around within a window of neighbouring scans: a branch
            more than 90 degrees from the reference scan's pose, as recorded, cannot win. False for
            views that come in no order.
        agree_at: shares of the run at which all tracks agree on which way is front; from then on
            a branch more than 90 degrees from its scan's agreed pose cannot win.
        hindsight: for what one branch wins: each `scan`, the views of a `track`, or a `batch`. The
            paper says "for each batch" (section 4.2), DPC's hindsight is each scan's.
    """

    beta: float = 0.05
    projection: Projection = field(default_factory=PolarBins)
    belief: float = 0.0
    time_ordered: bool = False
    agree_at: tuple[float, ...] = ()
    hindsight: Hindsight = "scan"


# From the cost of each branch, metres added to it when the winner is chosen: (B, K) to (B, K).
Handicap = Callable[[Tensor], Tensor]


class LossTerms(NamedTuple):
    """The loss and its parts.

    Attributes:
        total: scalar with a graph: mean over tracks of the sum over views (eq. 5).
        observation: mean first term, metres.
        projection: mean second term, metres.
        winner: branch that won, a scan each.
    """

    total: Float[Tensor, ""]
    observation: Float[Tensor, ""]
    projection: Float[Tensor, ""]
    winner: Int[Tensor, "B"]


def multiview_loss(
    scans: Float[Tensor, "B N 3"],
    centres: Float[Tensor, "B 3"],
    shapes: Float[Tensor, "I P 3"],
    rotation: Float[Tensor, "B K 3 3"],
    translation: Float[Tensor, "B K 3"],
    config: LossConfig,
    handicap: Handicap | None = None,
) -> LossTerms:
    """The shape of each track's reference scan, posed by every scan's own pose, explains it.

    Args:
        scans: centred scans, the views of a track next to each other: B = I x V.
        centres: of the scans in their sensor frames.
        shapes: canonical shape of the reference scan of each track.
        rotation: of every scan's pose hypotheses.
        translation: of the same.
        config: weights.
        handicap: what keeps branches from winning besides their cost, given that cost.
    """
    views = len(scans) // len(shapes)
    shape = shapes.repeat_interleave(views, dim=0)
    with torch.no_grad():
        posed = shape[:, None] @ rotation.mT + translation[:, :, None]
        scores = score_hypotheses(scans, centres, posed, config.projection)
        cost = scores.cost(config.beta)
        cost = cost if handicap is None else cost + handicap(cost)
        winner = winners(cost, views, config.hindsight)
    posed = _posed(shape, rotation, translation, winner)
    seen, made = (compared(cloud, centres, config.projection) for cloud in (scans, posed))
    observation, projection = _winner_terms(seen, made, scores, winner)
    total = (observation + config.beta * projection).mean() * views
    return LossTerms(total, observation.mean().detach(), projection.mean().detach(), winner)


def winners(cost: Float[Tensor, "B K"], views: int, hindsight: Hindsight) -> Int[Tensor, "B"]:
    """The branch of each scan that gets the gradient: that of least mean cost among its like.

    Args:
        cost: of the branches, metres, the views of a track next to each other.
        views: of a track.
        hindsight: whether a branch wins for a scan, for a track or for the whole batch.
    """
    if hindsight == "scan":
        return cost.argmin(-1)
    together = views if hindsight == "track" else len(cost)
    best = cost.unflatten(0, (-1, together)).mean(1).argmin(-1)
    return best.repeat_interleave(together)


def _posed(shape: Tensor, rotation: Tensor, translation: Tensor, winner: Tensor) -> Tensor:
    """Each shape under the winning hypothesis of its scan."""
    R = rotation.gather(1, winner[:, None, None, None].expand(-1, 1, 3, 3))[:, 0]
    t = translation.gather(1, winner[:, None, None].expand(-1, 1, 3))
    return shape @ R.mT + t


def _winner_terms(
    scans: Tensor, posed: Tensor, scores: Scores, winner: Tensor
) -> tuple[Tensor, Tensor]:
    """Both terms of the winning hypothesis of each scan, differentiable (winner takes all)."""
    rows = torch.arange(len(scans), device=scans.device)
    observation = observation_term(scans, posed, scores.to_shape[rows, winner])
    seen = scores.visible[rows, winner]
    projection = projection_term(posed, scans, scores.to_scan[rows, winner], seen)
    return observation, projection
