# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Differentiable projection of a point cloud (Insafutdinov and Dosovitskiy 2018, section 3).

Points are splatted into voxels, smoothed by a Gaussian and read as occupancies; along each ray of
the sensor these give the probability that it ends in each voxel, and with it silhouette and depth
(Tulsiani et al. 2017). Volumes are `(..., away, down, right)`.
"""

from itertools import product

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.baselines.dpc.viewing_volume import RangeImage

_FULL = 1 - 1e-5  # of an occupancy, so that its logarithm is finite
_REACH = 3.5  # half width of the smoothing kernel, sigmas


def splat(points: Float[Tensor, "B n 3"], size: int) -> Float[Tensor, "B S S S"]:
    """Each point's weight of 1 shared among the 8 voxels around it, linearly.

    Args:
        points: (right, down, away) in the cube of +-0.5; what lies outside has no weight there.
        size: voxels along an edge.
    """
    batch, count, _ = points.shape
    place = (points + 0.5) * size - 0.5
    lower = place.detach().floor()
    share = place - lower
    sides, low = (1 - share, share), lower.long()
    flat = points.new_zeros(batch, size**3)
    for corner in product((0, 1), repeat=3):
        weight = points.new_ones(batch, count)
        index = torch.zeros_like(low[..., 0])
        for axis in (2, 1, 0):
            at = low[..., axis] + corner[axis]
            weight = weight * sides[corner[axis]][..., axis] * ((at >= 0) & (at < size))
            index = index * size + at.clamp(0, size - 1)
        flat = flat.scatter_add(1, index, weight)
    return flat.view(batch, size, size, size)


def gaussian(size: int, sigma: float | Tensor, like: Tensor) -> Float[Tensor, "S S"]:
    """The smoothing along one axis as a matrix; a row's kernel sums to 1, borders cut it off.

    Args:
        size: voxels along the axis.
        sigma: of the Gaussian, voxels.
        like: its type and device are taken.
    """
    steps = torch.arange(size, dtype=like.dtype, device=like.device)
    apart = steps[:, None] - steps
    every = torch.arange(-size, size + 1, dtype=like.dtype, device=like.device)
    weight, whole = (
        torch.exp(-0.5 * (x / sigma) ** 2) * (x.abs() <= _REACH * sigma + 1) for x in (apart, every)
    )
    return weight / whole.sum()


def smooth(volume: Float[Tensor, "B S S S"], kernel: Float[Tensor, "S S"]) -> Tensor:
    """The volume smoothed along its three axes."""
    volume = volume @ kernel  # symmetric
    volume = kernel @ volume
    return torch.matmul(kernel, volume.flatten(2)).view_as(volume)


def occupancy(
    points: Float[Tensor, "B n 3"],
    size: int,
    sigma: float | Tensor,
    strength: Float[Tensor, "B"] | None = None,
) -> Float[Tensor, "B S S S"]:
    """How likely each voxel is filled.

    Args:
        points: in the cube.
        size: voxels along an edge.
        sigma: of the smoothing, voxels.
        strength: multiplies the smoothed volume, learned; 1 by default.
    """
    volume = smooth(splat(points, size).clamp(0, 1), gaussian(size, sigma, points))
    if strength is not None:
        volume = volume * strength[:, None, None, None]
    return volume.clamp(0, 1)


def let_by(volume: Float[Tensor, "*batch S S S"]) -> Float[Tensor, "*batch S S S"]:
    """Probability that a ray along the first of the last three axes passes each voxel.

    The product of all `1 - o` so far; its logarithm's sum is written as a matrix product, which is
    several times faster than a running sum over this axis.
    """
    size = volume.shape[-1]
    passed = torch.log1p(-volume.clamp(max=_FULL)).flatten(-2)
    so_far = torch.ones(size, size, dtype=volume.dtype, device=volume.device).tril()
    return (so_far @ passed).exp().view_as(volume)


def image_of(passed: Float[Tensor, "*batch S S S"]) -> RangeImage:
    """Probability that a ray ends at all, and where it is expected to; from `let_by`.

    Summed by parts: each voxel that is passed puts the end off by one.
    """
    size = passed.shape[-1]
    depth = (0.5 - size / 2) / size + passed.sum(-3) / size
    return RangeImage(1 - passed[..., -1, :, :], depth)


def project(
    points: Float[Tensor, "B n 3"],
    size: int,
    sigma: float | Tensor,
    strength: Float[Tensor, "B"] | None = None,
) -> RangeImage:
    """Silhouette and depth of points in the cube, as the sensor would see them."""
    return image_of(let_by(occupancy(points, size, sigma, strength)))
