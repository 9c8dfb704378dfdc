# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""LiDAR polar coordinates (paper eq. 4, METHOD 1 and 5): azimuth, pitch, range."""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

_SMALLEST_RANGE = 1e-6


class Spherical(NamedTuple):
    """Polar coordinates of points.

    Attributes:
        azimuth: `atan2(y, x)`, radians in (-pi, pi].
        pitch: `asin(z / r)`, radians.
        range: distance from the sensor, metres.
    """

    azimuth: Float[Tensor, "*batch"]
    pitch: Float[Tensor, "*batch"]
    range: Float[Tensor, "*batch"]


def to_spherical(points: Float[Tensor, "*batch 3"]) -> Spherical:
    """Cartesian (x forward, y left, z up) to polar; a point at the origin has pitch 0."""
    distance = points.square().sum(-1).clamp_min(_SMALLEST_RANGE**2).sqrt()
    pitch = torch.asin((points[..., 2] / distance).clamp(-1.0, 1.0))
    return Spherical(torch.atan2(points[..., 1], points[..., 0]), pitch, distance)


def from_spherical(polar: Spherical) -> Float[Tensor, "*batch 3"]:
    """Polar to Cartesian: the inverse of `to_spherical`."""
    flat = polar.range * polar.pitch.cos()
    x, y = flat * polar.azimuth.cos(), flat * polar.azimuth.sin()
    return torch.stack((x, y, polar.range * polar.pitch.sin()), dim=-1)


def wrap_angle(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """The same angle in [-pi, pi)."""
    return torch.remainder(angle + torch.pi, 2 * torch.pi) - torch.pi
