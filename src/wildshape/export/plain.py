# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of pose hypotheses in operations that every runtime has: no native code, no loops.

Same definitions as `losses/hindsight.py`, which the tests hold against these.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from wildshape.geometry.visibility import Bins, Projection, bin_points


def nearest_both_plain(
    a: Float[Tensor, "B N 3"], b: Float[Tensor, "B M 3"]
) -> tuple[Float[Tensor, "B N"], Float[Tensor, "B M"]]:
    """Distance of each point to the other set, from all pairs at once.

    One product gives |a|^2 + |b|^2 - 2 a.b, whose rounding is harmless near the origin: centred
    scans are given, so a distance errs by less than a millimetre where it is zero.
    """
    ones_a, ones_b = torch.ones_like(a[..., :1]), torch.ones_like(b[..., :1])
    left = torch.cat((a, a.square().sum(-1, keepdim=True), ones_a), dim=-1)
    right = torch.cat((-2 * b, ones_b, b.square().sum(-1, keepdim=True)), dim=-1)
    squared = left @ right.mT
    return _root(squared.amin(2)), _root(squared.amin(1))


def _root(squared: Tensor) -> Tensor:
    return squared.clamp_min(0.0).sqrt()


def visible_plain(bins: Bins) -> Bool[Tensor, "B N"]:
    """The nearest point of each bin, ties to the smallest index (`ops/zbuffer.py`).

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


def cost_plain(
    scans: Float[Tensor, "B N 3"],
    centres: Float[Tensor, "B 3"],
    posed: Float[Tensor, "B H P 3"],
    projection: Projection,
    beta: float,
) -> Float[Tensor, "B H"]:
    """The label-free cost of each hypothesis, metres (METHOD 6), one hypothesis after another."""
    costs = [
        _one(scans, centres, shape, projection, beta)
        for shape in posed.unbind(1)  # all at once would take several times the memory
    ]
    return torch.stack(costs, dim=1)


def _one(
    scans: Tensor, centres: Tensor, shape: Tensor, projection: Projection, beta: float
) -> Float[Tensor, "B"]:
    to_shape, to_scan = nearest_both_plain(scans, shape)
    seen = visible_plain(bin_points(shape + centres[:, None], centres, projection))
    return to_shape.mean(-1) + beta * _mean_of(to_scan, seen)


def _mean_of(values: Float[Tensor, "B N"], counted: Bool[Tensor, "B N"]) -> Float[Tensor, "B"]:
    number: Int[Tensor, "B"] = counted.sum(-1).clamp_min(1)
    return torch.where(counted, values, 0.0).sum(-1) / number
