# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of pose hypotheses in operations that every runtime has: no native code, no loops.

Same definitions as `method/hindsight.py`, which the tests hold against these.
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.image_plane import compared
from wildshape.geometry.projection.visibility import Bins, Projection, bin_points


def nearest_both_plain(
    a: Float[Tensor, "B N 3"], b: Float[Tensor, "B M 3"]
) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B M"]]:
    """Distance of each point to the other set, from all pairs at once."""
    squared = _squared(a, b)
    return _root(squared.amin(2)), _root(squared.amin(1))


def _squared(a: Float[Tensor, "B N 3"], b: Float[Tensor, "B M 3"]) -> Float[Tensor, "B N M"]:
    """Squared distances of all pairs.

    One product gives |a|^2 + |b|^2 - 2 a.b, whose rounding is harmless near the origin: centred
    scans are given, so a distance errs by less than a millimetre where it is zero.
    """
    ones_a, ones_b = torch.ones_like(a[..., :1]), torch.ones_like(b[..., :1])
    left = torch.cat((a, a.square().sum(-1, keepdim=True), ones_a), dim=-1)
    right = torch.cat((-2 * b, ones_b, b.square().sum(-1, keepdim=True)), dim=-1)
    return left @ right.mT


def _root(squared: Tensor) -> Tensor:
    return squared.clamp_min(0.0).sqrt()


def visible_plain(bins: Bins) -> Bool[Tensor, "B N"]:
    """The nearest point of each bin, ties to the smallest index (`ops/zbuffer/__init__.py`).

    Two scatters, the nearest depth and then the first index that has it, instead of one of both
    packed into an integer, for which runtimes lack the cast of bits.
    """
    rows, points = bins.index.shape
    inside = (bins.index >= 0) & (bins.index < bins.count)
    cell = torch.where(inside, bins.index, bins.count)  # the last place takes the rest
    nowhere = bins.depth.new_full((rows, bins.count + 1), torch.inf)
    least = nowhere.scatter_reduce(1, cell, bins.depth, "amin").gather(1, cell)
    order = torch.arange(points, device=cell.device).expand(rows, points)
    candidate = torch.where(inside & (bins.depth == least), order, points)
    none = torch.full_like(nowhere, points, dtype=torch.int64)
    first = none.scatter_reduce(1, cell, candidate, "amin").gather(1, cell)
    return inside & (order == first)


class PlainScores(NamedTuple):
    """Both terms of the loss for every hypothesis, and how far shapes are from their scans.

    Attributes:
        observation: `CD(X -> Y)`, metres (paper eq. 2).
        projection: `CD(visible(Y) -> X)`, metres (paper eq. 3).
        to_scan: of every posed point, metres: in space, also where the terms compare projections.
    """

    observation: Float[Tensor, "B H"]
    projection: Float[Tensor, "B H"]
    to_scan: Float[Tensor, "B H P"]

    def cost(self, beta: float) -> Float[Tensor, "B H"]:
        """The label-free cost of each hypothesis, metres (METHOD 6)."""
        return self.observation + beta * self.projection


def score_plain(
    scans: Float[Tensor, "B N 3"],
    centres: Float[Tensor, "B 3"],
    posed: Float[Tensor, "B H P 3"],
    projection: Projection,
) -> PlainScores:
    """`score_hypotheses`, all pairs of points in memory: 4 H N P bytes a scan."""
    hypotheses = posed.shape[1]
    flat = posed.flatten(0, 1)
    repeated, middle = _repeat(scans, hypotheses), _repeat(centres, hypotheses)
    both = tuple(compared(cloud, middle, projection) for cloud in (repeated, flat))
    to_shape, to_scan = nearest_both_plain(*both)
    seen = visible_plain(bin_points(flat + middle[:, None], middle, projection))
    terms = (to_shape.mean(-1), _mean_of(to_scan, seen))
    if projection.flat:
        nearest = _squared(*both).argmin(1)
        to_scan = (flat - repeated.gather(1, nearest[..., None].expand(-1, -1, 3))).norm(dim=-1)
    found = (*terms, to_scan)
    return PlainScores(*(part.unflatten(0, (-1, hypotheses)) for part in found))


def _repeat(rows: Tensor, times: int) -> Tensor:
    """Each row so many times in a row."""
    return rows[:, None].expand(-1, times, *rows.shape[1:]).flatten(0, 1)


def _mean_of(values: Float[Tensor, "B N"], counted: Bool[Tensor, "B N"]) -> Float[Tensor, "B"]:
    number = counted.sum(-1).clamp_min(1)
    return torch.where(counted, values, 0.0).sum(-1) / number
