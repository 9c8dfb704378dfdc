# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One-way Chamfer distance (paper eq. 2 and 3): Euclidean, not squared, not halved."""

from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.ops.nearest import nearest_distance


def one_way_chamfer(
    source: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    counted: Bool[Tensor, "B N"] | None = None,
) -> Float[Tensor, "B"]:
    """`CD(source -> target)`: mean over source points of the distance to the nearest target point.

    Args:
        source: points whose mean is taken.
        target: points that are searched.
        counted: which source points the mean runs over; all by default.
    """
    return masked_mean(nearest_distance(source, target), counted)


def chamfer(a: Float[Tensor, "B N 3"], b: Float[Tensor, "B M 3"]) -> Float[Tensor, "B"]:
    """`CD(a -> b) + CD(b -> a)`: precision plus coverage (METHOD 8)."""
    return one_way_chamfer(a, b) + one_way_chamfer(b, a)


def masked_mean(
    values: Float[Tensor, "B N"], counted: Bool[Tensor, "B N"] | None
) -> Float[Tensor, "B"]:
    """Mean over the counted entries of each row; 0 where none is counted."""
    if counted is None:
        return values.mean(-1)
    weight = counted.to(values.dtype)
    return (values * weight).sum(-1) / weight.sum(-1).clamp_min(1.0)
