# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Planes through neighbourhoods of points, many at once, on any device."""

import math

import torch
from jaxtyping import Float, Int64
from torch import Tensor

_TINY = 1e-30


def gathered(points: Float[Tensor, "B P 3"], index: Int64[Tensor, "B *n"]) -> Tensor:
    """`(B, *n, 3)`: the points of each cloud at these places of it."""
    flat = index.flatten(1)[..., None].expand(-1, -1, 3)
    return points.gather(1, flat).view(*index.shape, 3)


def planes(
    points: Float[Tensor, "B P 3"], around: Int64[Tensor, "B n k"]
) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B n 3"]]:
    """The middle of each neighbourhood and the unit normal of the plane through it.

    Args:
        points: clouds.
        around: places in the cloud of the k points of each neighbourhood.
    """
    axes = [gathered_axis(points[..., c], around) for c in range(3)]
    middle = [axis.mean(-1) for axis in axes]
    off = [axis - mean[..., None] for axis, mean in zip(axes, middle)]
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    moments = torch.stack([(off[i] * off[j]).sum(-1) for i, j in pairs])
    return torch.stack(middle, dim=-1), thinnest_axis(moments)


def gathered_axis(values: Float[Tensor, "B P"], around: Int64[Tensor, "B n k"]) -> Tensor:
    """`(B, n, k)`: one coordinate of the points at these places."""
    return values.gather(1, around.flatten(1)).view(around.shape)


def thinnest_axis(moments: Float[Tensor, "6 *batch"]) -> Float[Tensor, "*batch 3"]:
    """Unit eigenvector of the smallest eigenvalue of symmetric matrices, in closed form.

    Eigenvalues by Smith (1961). The rows of `A - l` lie across the eigenvector: it is the longest
    of their three cross products. Where two eigenvalues are equal any such vector is given.

    Args:
        moments: xx, xy, xz, yy, yz, zz of each matrix; best in float64.
    """
    middle = (moments[0] + moments[3] + moments[5]) / 3
    a, d, f = (moments[i] - middle for i in (0, 3, 5))
    b, c, e = moments[1], moments[2], moments[4]
    spread = ((a * a + d * d + f * f + 2 * (b * b + c * c + e * e)) / 6).clamp_min(_TINY).sqrt()
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    angle = (determinant / (2 * spread**3)).clamp(-1, 1).acos() / 3
    least = 2 * spread * torch.cos(angle + 2 * math.pi / 3)
    a, d, f = a - least, d - least, f - least
    crossed = (
        (b * e - c * d, c * b - a * e, a * d - b * b),
        (b * f - c * e, c * c - a * f, a * e - b * c),
        (d * f - e * e, e * c - b * f, b * e - d * c),
    )
    best, longest = (torch.zeros_like(a), torch.zeros_like(a), torch.ones_like(a)), 0 * a + _TINY
    for vector in crossed:
        length = vector[0].square() + vector[1].square() + vector[2].square()
        longer = length > longest
        best = tuple(torch.where(longer, new, old) for new, old in zip(vector, best))
        longest = torch.where(longer, length, longest)
    return torch.nn.functional.normalize(torch.stack(best, dim=-1), dim=-1)
