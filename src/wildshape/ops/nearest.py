# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours: the one door. Backends lie beside it (`nearest_torch`, ...)."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.nearest_torch import nearest_reference
from wildshape.ops.neighbours import Neighbours

__all__ = ["Neighbours", "nearest", "nearest_both", "nearest_distance"]


def nearest(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    query_sizes: Int64[Tensor, "B"] | None = None,
    target_sizes: Int64[Tensor, "B"] | None = None,
) -> Neighbours:
    """The nearest target of each query, ties to the smallest index; no gradient.

    Args:
        query: `(B, N, 3)` points.
        target: `(B, M, 3)` points in the same frame and unit.
        query_sizes: points in use a row, the rest is padding; all if None.
        target_sizes: the same for the targets.

    Returns:
        Squared distances (inf where a row has no target, 0 for padding) and indices.
    """
    return nearest_reference(query.detach(), target.detach(), query_sizes, target_sizes)


def nearest_both(
    a: Float[Tensor, "B N 3"],
    b: Float[Tensor, "B M 3"],
    a_sizes: Int64[Tensor, "B"] | None = None,
    b_sizes: Int64[Tensor, "B"] | None = None,
) -> tuple[Neighbours, Neighbours]:
    """`nearest` from a to b and from b to a in one call."""
    return nearest(a, b, a_sizes, b_sizes), nearest(b, a, b_sizes, a_sizes)


def nearest_distance(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    neighbours: Neighbours | None = None,
) -> Float[Tensor, "B N"]:
    """Euclidean distance of each query to its nearest target, differentiable in both.

    The choice of the neighbour is a constant; the gradient at distance zero is zero.

    Args:
        query: `(B, N, 3)` points.
        target: `(B, M, 3)` points.
        neighbours: of `nearest(query, target, ...)`, searched here if None.

    Returns:
        `(B, N)` distances; inf where a row has no target, 0 for padding; both without gradient.
    """
    found = nearest(query, target) if neighbours is None else neighbours
    if target.shape[1] == 0:
        return found.distance_squared
    chosen = target.gather(1, found.index[..., None].expand(-1, -1, 3))
    d2 = (query - chosen).square().sum(-1)
    known = found.distance_squared.isfinite() & (found.distance_squared > 0)
    safe = torch.where(known, d2, 1.0).clamp_min(torch.finfo(d2.dtype).tiny)
    return torch.where(known, safe.sqrt(), found.distance_squared)
