# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a scan's own frame has its origin, found without any label (METHOD 2)."""

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.projection.spherical import (
    Spherical,
    from_spherical,
    to_spherical,
    wrap_angle,
)


def _middle(values: Float[Tensor, "*batch n"]) -> Float[Tensor, "*batch"]:
    return (values.amin(-1) + values.amax(-1)) / 2


def frustum_centre(points: Float[Tensor, "*batch n 3"]) -> Float[Tensor, "*batch 3"]:
    """Middle of the bounding frustum in (azimuth, pitch, range), turned back to Cartesian.

    Azimuths are taken relative to that of the mean direction, so an object across the +-pi seam
    is not torn apart.
    """
    polar = to_spherical(points)
    forward = torch.atan2(polar.azimuth.sin().mean(-1), polar.azimuth.cos().mean(-1))
    azimuth = forward + _middle(wrap_angle(polar.azimuth - forward[..., None]))
    return from_spherical(Spherical(azimuth, _middle(polar.pitch), _middle(polar.range)))


def box_centre(points: Float[Tensor, "*batch n 3"]) -> Float[Tensor, "*batch 3"]:
    """Middle of the axis-aligned bounding box."""
    return (points.amin(-2) + points.amax(-2)) / 2


def scan_centre(points: Float[Tensor, "*batch n 3"], sensor_kind: str) -> Float[Tensor, "*batch 3"]:
    """`frustum_centre` for a LiDAR scan, `box_centre` for a depth camera's."""
    return frustum_centre(points) if sensor_kind == "lidar" else box_centre(points)
