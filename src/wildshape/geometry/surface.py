# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Clouds as surfaces: their reflections, and the planes of neighbourhoods, many at once."""

import math

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.library import added_kernel
from wildshape.ops.planes import planes_native

# Squared: how far off a line a neighbourhood is at least that has a plane, of its size.
_LINE = 1e-20


def gathered(points: Float[Tensor, "B P 3"], index: Int64[Tensor, "B *n"]) -> Tensor:
    """`(B, *n, 3)`: the points of each cloud at these places of it."""
    flat = index.flatten(1)[..., None].expand(-1, -1, 3)
    return points.gather(1, flat).view(*index.shape, 3)


def is_mirrored(shapes: Float[Tensor, "B P 3"]) -> bool:
    """Whether the second half of the points is the reflection of the first in y = 0."""
    half = shapes.shape[1] // 2
    return torch.equal(shapes[:, half:], reflected(shapes[:, :half]))


def mirrored(shapes: Float[Tensor, "B P 3"]) -> Float[Tensor, "B Q 3"]:
    """The points, then their reflections in y = 0."""
    return torch.cat((shapes, reflected(shapes)), dim=1)


def reflected(points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """Points or directions, reflected in y = 0."""
    return points * points.new_tensor((1.0, -1.0, 1.0))


def planes(
    points: Float[Tensor, "B P 3"], around: Int64[Tensor, "B n k"]
) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B n 3"]]:
    """The middle of each neighbourhood and the unit normal of the plane through it.

    Args:
        points: clouds.
        around: places in the cloud of the k points of each neighbourhood.
    """
    if points.device.type == "cpu" and not points.requires_grad and added_kernel("planes"):
        return planes_native(points, around)
    return planes_torch(points, around)


def planes_torch(
    points: Float[Tensor, "B P 3"], around: Int64[Tensor, "B n k"]
) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B n 3"]]:
    """The same on any device."""
    middle, spread = moments(points, around)
    return middle, thinnest_axis(spread.double()).to(points.dtype)


def moments(
    points: Float[Tensor, "B P 3"], around: Int64[Tensor, "B n k"]
) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "6 B n"]]:
    """The middle of each neighbourhood, and the sums xx, xy, xz, yy, yz, zz around it."""
    axes = [gathered_axis(points[..., c], around) for c in range(3)]
    middle = [axis.mean(-1) for axis in axes]
    off = [axis - mean[..., None] for axis, mean in zip(axes, middle)]
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    return torch.stack(middle, -1), torch.stack([(off[i] * off[j]).sum(-1) for i, j in pairs])


def gathered_axis(values: Float[Tensor, "B P"], around: Int64[Tensor, "B n k"]) -> Tensor:
    """`(B, n, k)`: one coordinate of the points at these places."""
    return values.gather(1, around.flatten(1)).view(around.shape)


def thinnest_axis(moments: Float[Tensor, "6 *batch"]) -> Float[Tensor, "*batch 3"]:
    """Unit eigenvector of the smallest eigenvalue of symmetric matrices, in closed form.

    Eigenvalues by Smith (1961). The rows of `A - l` lie across the eigenvector: it is the longest
    of their three cross products. Where two eigenvalues are equal any such vector is given. The
    rows are shares of the matrix's spread: a small cloud is as a large one.

    Args:
        moments: xx, xy, xz, yy, yz, zz of each matrix; in float64, for products are subtracted.
    """
    middle = (moments[0] + moments[3] + moments[5]) / 3
    a, d, f = (moments[i] - middle for i in (0, 3, 5))
    b, c, e = moments[1], moments[2], moments[4]
    spread = ((a * a + d * d + f * f + 2 * (b * b + c * c + e * e)) / 6).sqrt()
    share = torch.where(spread > 0, 1 / spread, 0.0)
    a, b, c, d, e, f = (value * share for value in (a, b, c, d, e, f))
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    least = 2 * torch.cos((determinant / 2).clamp(-1, 1).acos() / 3 + 2 * math.pi / 3)
    a, d, f = a - least, d - least, f - least
    rows = torch.stack([torch.stack(row, -1) for row in ((a, b, c), (b, d, e), (c, e, f))])
    crossed = rows[[0, 0, 1]].cross(rows[[1, 2, 2]], dim=-1)
    found = _longest(crossed)
    line = found.square().sum(-1, keepdim=True) <= _LINE
    found = torch.where(line, _across(_longest(rows)), found)
    return torch.nn.functional.normalize(found, dim=-1)


def _longest(vectors: Float[Tensor, "k *batch 3"]) -> Float[Tensor, "*batch 3"]:
    """Of each k of them."""
    best = vectors.square().sum(-1).argmax(0)
    return vectors.gather(0, best[None, ..., None].expand(1, *best.shape, 3))[0]


def _across(vectors: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """Some vector at right angles to each."""
    unit = torch.nn.functional.one_hot(vectors.abs().argmin(-1), 3)
    return vectors.cross(unit.to(vectors.dtype), dim=-1)
