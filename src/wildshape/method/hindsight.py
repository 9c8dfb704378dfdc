# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scoring every pose hypothesis at once, and the winner (METHOD 4 to 6, hindsight loss).

The search for neighbours and the z-buffer run without a graph for all hypotheses; the winner alone
is then differentiated, through the neighbours already found.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int, Int64
from torch import Tensor
from torch.profiler import record_function

from wildshape.geometry.projection.image_plane import compared
from wildshape.geometry.projection.visibility import Projection, bin_points
from wildshape.method.observation import masked_mean
from wildshape.ops.nearest import Neighbours, nearest_both
from wildshape.ops.zbuffer import visible


class Scores(NamedTuple):
    """Both terms of the loss for every hypothesis, and what is needed to differentiate one.

    Attributes:
        observation: `CD(X -> Y)`, metres (paper eq. 2).
        projection: `CD(visible(Y) -> X)`, metres (paper eq. 3).
        to_shape: neighbours of scan points in the posed shape.
        to_scan: neighbours of posed points in the scan.
        visible: the posed points that the sensor would see.
        free_space: what shape costs that stands where rays passed, metres, where any are known.
    """

    observation: Float[Tensor, "B H"]
    projection: Float[Tensor, "B H"]
    to_shape: Int[Tensor, "B H N"]
    to_scan: Int[Tensor, "B H P"]
    visible: Bool[Tensor, "B H P"]
    free_space: Float[Tensor, "B H"] | None = None

    def cost(self, beta: float) -> Float[Tensor, "B H"]:
        """The label-free cost of each hypothesis, metres (METHOD 6, 13)."""
        cost = self.observation + beta * self.projection
        return cost if self.free_space is None else cost + self.free_space


def _mean_distance(found: Neighbours, counted: Tensor | None = None) -> Tensor:
    return masked_mean(found.distance_squared.sqrt(), counted)


def repeats(sizes: Int64[Tensor, "B"], count: int) -> Int64[Tensor, "B N"]:
    """How often each point is there where the first `sizes` are repeated up to `count` points."""
    place = torch.arange(count, device=sizes.device)
    often = count // sizes[:, None] + (place < count % sizes[:, None])
    return torch.where(place < sizes[:, None], often, 0)


@torch.no_grad()
def score_hypotheses(
    scans: Float[Tensor, "B N 3"],
    centres: Float[Tensor, "B 3"],
    posed: Float[Tensor, "B H P 3"],
    projection: Projection,
    sizes: Int64[Tensor, "B"] | None = None,
) -> Scores:
    """Both loss terms of every posed shape against its scan.

    Args:
        scans: centred scans.
        centres: where each scan's centre lies in its sensor frame.
        posed: shapes in the scans' centred frames, H hypotheses each.
        projection: how the sensor's image is binned.
        sizes: points of each scan that come first; all others repeat one of them, and are not
            searched again. By default all.
    """
    count, hypotheses, size, _ = posed.shape
    flat = posed.flatten(0, 1)
    repeated = scans[:, None].expand(-1, hypotheses, -1, -1).flatten(0, 1)
    middle = centres[:, None].expand(-1, hypotheses, -1).flatten(0, 1)
    with record_function("wildshape: search"):
        seen_points, shape_points = (
            compared(cloud, middle, projection) for cloud in (repeated, flat)
        )
        own = None if sizes is None else sizes.repeat_interleave(hypotheses)
        to_shape, to_scan = nearest_both(seen_points, shape_points, own)
        often = None if own is None else repeats(own, scans.shape[1])
    with record_function("wildshape: z-buffer"):
        bins = bin_points(flat + middle[:, None], middle, projection)
        seen = visible(bins.index, bins.depth, bins.count)
    shape = (count, hypotheses)
    return Scores(
        _mean_distance(to_shape, often).view(shape),
        _mean_distance(to_scan, seen).view(shape),
        to_shape.index.view(*shape, -1),
        to_scan.index.view(*shape, size),
        seen.view(*shape, size),
    )
