# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points where they lie in the sensor's image: what is compared by losses on 2D projections.

The paper's variant for cars (supplement, "Ours*"): input and output points are both projected, and
their distances are those of the projections. How far away a point is no longer counts.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.projection.spherical import to_spherical
from wildshape.geometry.projection.visibility import PixelBins, Projection, facing_rotation

_NEAREST = 0.1


def compared(
    centred: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"], projection: Projection
) -> Float[Tensor, "B N 3"]:
    """The points between which distances are measured: as they are, or in the image if `flat`.

    Args:
        centred: points beside their scan's centre, in the sensor's axes.
        centre: of each scan, sensor frame.
        projection: of the sensor.
    """
    if not projection.flat:
        return centred
    points = centred + centre[:, None]
    if isinstance(projection, PixelBins):
        return in_pinhole_image(points, centre)
    return in_polar_image(points, centre)


def in_pinhole_image(
    points: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"]
) -> Float[Tensor, "B N 3"]:
    """Points moved along their rays to the plane of the centre's depth, which is made z = 0.

    Points nearer than a tenth of that depth, or behind, are taken as if they were so near.
    """
    depth = centre[:, None, 2:].clamp_min(1e-6)
    scale = depth / torch.maximum(points[..., 2:], _NEAREST * depth)
    return _flat(points[..., :2] * scale)


def in_polar_image(
    points: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"]
) -> Float[Tensor, "B N 3"]:
    """Azimuth and pitch about the line to the centre, times the centre's distance; third is 0."""
    polar = to_spherical(points @ facing_rotation(centre).mT)
    angles = torch.stack((polar.azimuth, polar.pitch), dim=-1)
    return _flat(angles * centre.norm(dim=-1)[:, None, None])


def _flat(places: Float[Tensor, "B N 2"]) -> Float[Tensor, "B N 3"]:
    return torch.nn.functional.pad(places, (0, 1))
