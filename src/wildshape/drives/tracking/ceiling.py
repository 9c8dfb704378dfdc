# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The ceiling of a car park or a tunnel: flat, and at one height above the sensor."""

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.config import TrajectoryConfig
from wildshape.records import Points

_FEWEST_POINTS = 100
_SWAY = 0.02  # a degree, of a sensor that is held level


def at_ceiling(
    level: Points, away: Float[np.ndarray, "n"], config: TrajectoryConfig
) -> Bool[np.ndarray, "n"]:
    """Which points lie at a ceiling or above it, if what is overhead nearby has one height."""
    overhead = (away < config.overhead_m) & (level[:, 2] > config.overhead * away)
    if overhead.sum() < _FEWEST_POINTS:
        return np.zeros(len(level), bool)
    height, far = level[overhead, 2], away[overhead]
    if _middle_half(height) >= config.ceiling * np.median(far) * _middle_half(height / far):
        return np.zeros(len(level), bool)
    return level[:, 2] > np.median(height) - config.ceiling_m - _SWAY * away


def _middle_half(values: Float[np.ndarray, "n"]) -> float:
    """From the lower to the upper quartile."""
    return float(np.subtract(*np.percentile(values, (75, 25))))
