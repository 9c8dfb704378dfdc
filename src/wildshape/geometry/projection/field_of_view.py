# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a LiDAR's view ends above: what lies higher was not free, only not looked at.

Beyond the paper. The uppermost beam of an HDL-64E looks 2 degrees up; of a truck nearby it sees
half. No sensor's data sheet is asked: a track shows where its view ended.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

_SAME_DEG = 0.25  # scans that end within this of the highest end at the same place
_FEWEST = 3  # of such scans that show the end of a view


def slope(points: Float[Tensor, "... 3"]) -> Float[Tensor, "..."]:
    """Tangent of each point's elevation; z up, any unit."""
    return points[..., 2] / torch.hypot(points[..., 0], points[..., 1]).clamp_min(1e-9)


def view_top(highest: Sequence[float]) -> float:
    """Slope at which the sensor's view ended on an object; infinite if it did not.

    The top of an object comes lower into view the farther away it is, the end of the view stays
    where it is. So the view ended on the object if several scans reach equally high, above the
    horizon. (A sensor of few beams that follows a van at one distance shows the same; what is then
    held for unknown, above the roof of the van, does little harm.)

    Args:
        highest: `slope` of the highest point of each scan of a track, sensor frame.
    """
    if len(highest) == 0:
        return math.inf
    top = max(highest)
    alike = sum(value >= top - math.tan(math.radians(_SAME_DEG)) for value in highest)
    return top if top > 0 and alike >= _FEWEST else math.inf


def within_view(rays: Float[Tensor, "B P 3"], top: Float[Tensor, "B"]) -> Bool[Tensor, "B P"]:
    """Which points, relative to the sensor, z up, lie below the end of the view."""
    return slope(rays) <= top[:, None]


def highest_seen(
    x_y: Float[Tensor, "R 2"], sensors: Float[Tensor, "O 3"], top: float
) -> Float[Tensor, "R"]:
    """Height up to which at least one of the sensors saw, above places of the ground plane.

    Args:
        x_y: the places.
        sensors: in the same frame, z up.
        top: `view_top`.
    """
    if math.isinf(top):
        return x_y.new_full((len(x_y),), math.inf)
    return (sensors[:, 2] + top * torch.cdist(x_y, sensors[:, :2])).amax(1)
