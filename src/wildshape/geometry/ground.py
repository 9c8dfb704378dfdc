# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground that came along with the scans of a vehicle (beyond the paper).

Crops of vehicles often hold some ground around the wheels: a skirt, low, and further out than
anything above it. Fused scans must not teach it as shape, and a shape must not be drawn to it.
"""

import numpy as np
from jaxtyping import Bool, Float

_LOW, _ABOVE, _BEYOND, _ENDS, _FEWEST = 0.2, 0.35, 0.08, 0.01, 50


def skirt(
    points: Float[np.ndarray, "n 3"], shape: Float[np.ndarray, "m 3"] | None = None
) -> Bool[np.ndarray, "n"]:
    """The points that are low and beside everything higher of the vehicle.

    Args:
        points: canonical frame, z up, metres.
        shape: the vehicle, the same frame; by default what the points are of.
    """
    whole = points if shape is None else shape
    low = np.quantile(whole[:, 2], _ENDS)
    body = whole[whole[:, 2] > low + _ABOVE, :2]
    if len(body) < _FEWEST:
        return np.zeros(len(points), dtype=bool)
    near, far = np.quantile(body, (_ENDS, 1 - _ENDS), axis=0)
    beside = (points[:, :2] < near - _BEYOND) | (points[:, :2] > far + _BEYOND)
    return (points[:, 2] < low + _LOW) & beside.any(axis=1)
