# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Bins of the sensor's own image in which the nearest point hides the rest (METHOD 5, paper 4.4).

Three ways to bin. Each gives `(bin, depth, count)`; `wildshape.ops.zbuffer.visible` does the rest.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from wildshape.geometry.projection.spherical import to_spherical

_WINDOW = 256  # a power of two
_BEHIND = 1e-3


@dataclass(frozen=True)
class Bins:
    """Bin of each point (-1: not in the image), its depth, and how many bins there are."""

    index: Int[Tensor, "B N"]
    depth: Float[Tensor, "B N"]
    count: int


@dataclass(frozen=True)
class PolarBins:
    """The paper's bins: `(floor(phi / d_phi), floor(theta / d_theta))`, radians.

    With `flat`, scan and shape are compared in the image alone (`image_plane.py`).
    """

    d_azimuth: float = 0.02
    d_pitch: float = 0.02
    flat: bool = False


@dataclass(frozen=True)
class FacingBins:
    """Polar bins in axes turned to face the object, their width `cell_m` metres at its centre.

    Free of the seam and the poles, and equally coarse on the object at every range: fixed angles
    let the far side shine through near objects, whose points are farther apart than a bin.
    With `flat`, scan and shape are compared in the image alone (`image_plane.py`).
    """

    cell_m: float = 0.2
    flat: bool = False


@dataclass(frozen=True)
class PixelBins:
    """Square pixels of a pinhole image: `(floor(x / z / cell), floor(y / z / cell))`.

    `cell` is the pixel's width over the focal length, so no intrinsics are needed.
    With `flat`, scan and shape are compared in the image alone (`image_plane.py`).
    """

    cell: float = 1 / 30
    flat: bool = False


Projection = PolarBins | FacingBins | PixelBins


def polar_bins(points: Float[Tensor, "B N 3"], bins: PolarBins) -> Bins:
    """Bins over the whole sphere, in the sensor's own axes (paper eq. 4)."""
    polar = to_spherical(points)
    columns = math.ceil(2 * torch.pi / bins.d_azimuth)  # fewer would join bins that do not touch
    rows = 2 * math.ceil(torch.pi / 2 / bins.d_pitch) + 1  # so that no two heights share a row
    u = torch.floor(polar.azimuth / bins.d_azimuth).long() % columns
    v = torch.floor(polar.pitch / bins.d_pitch).long() % rows
    return Bins(u * rows + v, polar.range, columns * rows)


def facing_rotation(direction: Float[Tensor, "B 3"]) -> Float[Tensor, "B 3 3"]:
    """Rotation that turns `direction` to +x, the least turned about it otherwise."""
    forward = torch.nn.functional.normalize(direction, dim=-1)
    up = torch.zeros_like(forward)
    steep = forward[..., 2].abs() > 0.9
    up[..., 2] = (~steep).to(up.dtype)
    up[..., 0] = steep.to(up.dtype)
    left = torch.nn.functional.normalize(torch.linalg.cross(up, forward), dim=-1)
    return torch.stack((forward, left, torch.linalg.cross(forward, left)), dim=-2)


def facing_bins(
    points: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"], bins: FacingBins
) -> Bins:
    """Bins of `cell_m` metres at the distance of `centre`, in axes that face it."""
    # Coordinate by coordinate in memory: a CPU takes the angles of many points at once there.
    turned = (facing_rotation(centre) @ points.mT).mT
    polar = to_spherical(turned)
    cell = bins.cell_m / centre.norm(dim=-1).clamp_min(bins.cell_m)
    u = torch.floor(polar.azimuth / cell[:, None]).long() & (_WINDOW - 1)
    v = torch.floor(polar.pitch / cell[:, None]).long() & (_WINDOW - 1)
    return Bins(u * _WINDOW + v, polar.range, _WINDOW * _WINDOW)


def pixel_bins(points: Float[Tensor, "B N 3"], bins: PixelBins) -> Bins:
    """Bins of a pinhole image; points behind the camera are in none."""
    depth = points[..., 2]
    in_front = depth > _BEHIND
    safe = torch.where(in_front, depth, torch.ones_like(depth))
    half = _WINDOW // 2
    u = torch.floor(points[..., 0] / safe / bins.cell).long() + half
    v = torch.floor(points[..., 1] / safe / bins.cell).long() + half
    inside = in_front & (u >= 0) & (v >= 0) & (u < _WINDOW) & (v < _WINDOW)
    return Bins(torch.where(inside, u * _WINDOW + v, -1), depth, _WINDOW * _WINDOW)


def bin_points(
    points: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"], projection: Projection
) -> Bins:
    """Bin points `(B, N, 3)` of the sensor frame; `centre` is each scan's own centre there."""
    match projection:
        case PolarBins():
            return polar_bins(points, projection)
        case FacingBins():
            return facing_bins(points, centre, projection)
        case PixelBins():
            return pixel_bins(points, projection)
