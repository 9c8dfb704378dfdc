# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground that came along with the scans of a track (beyond the paper).

Crops of vehicles often hold some ground around the wheels. Fused, it is a skirt: low, and further
out than anything above it. A network should see it in scans and not learn it as shape.
"""

import numpy as np
from jaxtyping import Bool, Float

_LOW, _ABOVE, _BEYOND, _ENDS, _FEWEST = 0.2, 0.35, 0.08, 0.01, 50


def skirt(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """The points of a fused vehicle that are low and beside everything higher.

    Args:
        points: canonical frame, z up, metres.
    """
    height = points[:, 2] - np.quantile(points[:, 2], _ENDS)
    body = points[height > _ABOVE, :2]
    if len(body) < _FEWEST:
        return np.zeros(len(points), dtype=bool)
    low, high = np.quantile(body, (_ENDS, 1 - _ENDS), axis=0)
    beside = (points[:, :2] < low - _BEYOND) | (points[:, :2] > high + _BEYOND)
    return (height < _LOW) & beside.any(axis=1)
