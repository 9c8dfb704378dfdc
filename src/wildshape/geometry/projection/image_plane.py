# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points projected to a plane: what is compared by losses on 2D projections.

The paper's variant for cars (supplement, "Ours*"): input and output points are both projected, and
their distances are those of the projections. The paper does not say how. Here the projection is
parallel: along rays, all shapes that are larger by as much as they are farther away look alike,
nothing holds the depth, and training diverges (`docs/decisions.md`).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.projection.visibility import PixelBins, Projection, facing_rotation


def compared(
    centred: Float[Tensor, "B N 3"], centre: Float[Tensor, "B 3"], projection: Projection
) -> Float[Tensor, "B N 3"]:
    """The points between which distances are measured: as they are, or projected if `flat`.

    A camera's are projected along its axis, a LiDAR's along the line to the scan's centre. Metres
    stay metres; the third coordinate is 0.

    Args:
        centred: points beside their scan's centre, in the sensor's axes.
        centre: of each scan, sensor frame.
        projection: of the sensor.
    """
    if not projection.flat:
        return centred
    if isinstance(projection, PixelBins):
        return _flat(centred[..., :2])
    return _flat((centred @ facing_rotation(centre).mT)[..., 1:])


def _flat(places: Float[Tensor, "B N 2"]) -> Float[Tensor, "B N 3"]:
    return torch.nn.functional.pad(places, (0, 1))
