# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground that came along with the scans of a vehicle (beyond the paper).

Crops of vehicles often hold some ground around the wheels: a skirt, low, and further out than
anything above it. Fused scans must not teach it as shape, and a shape must not be drawn to it.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32

from wildshape.geometry.sampling import quantiles
from wildshape.geometry.transforms.se3 import SE3


@dataclass(frozen=True)
class SkirtRule:
    """What counts as ground around a vehicle.

    Attributes:
        low_m: a point of the skirt is lower than this above the lowest, metres.
        above_m: what is higher than this above the lowest is the body, metres: over any kerb.
        beyond_m: a point of the skirt is so far outside of the body, metres.
        ends: share of the points that may be strays at each end.
        fewest: points of the body without which nothing is said.
    """

    low_m: float = 0.2
    above_m: float = 0.35
    beyond_m: float = 0.08
    ends: float = 0.01
    fewest: int = 50


_RULE = SkirtRule()


def skirt(
    points: Float[np.ndarray, "n 3"], shape: Float[np.ndarray, "m 3"] | None = None
) -> Bool[np.ndarray, "n"]:
    """The points that are low and beside everything higher of the vehicle.

    Args:
        points: canonical frame, z up, metres.
        shape: the vehicle, the same frame; by default what the points are of.
    """
    whole = points if shape is None else shape
    height = whole[:, 2]
    low = quantiles(height[None], (_RULE.ends,)).item()
    body = whole[height > low + _RULE.above_m, :2].T
    if body.shape[1] < _RULE.fewest:
        return np.zeros(len(points), dtype=bool)
    near, far = quantiles(body.copy(), (_RULE.ends, 1 - _RULE.ends))
    found = points[:, 2] < low + _RULE.low_m
    lows = points[found, :2]
    beside = (lows < near - _RULE.beyond_m) | (lows > far + _RULE.beyond_m)
    found[found] = beside.any(axis=1)
    return found


def without_skirt(
    scan: Float32[np.ndarray, "n 3"],
    shape: Float[np.ndarray, "m 3"],
    T_sensor_canonical: SE3,
    fewest: int,
) -> Float32[np.ndarray, "k 3"]:
    """A scan without the ground beside its object, or as it is if fewer points would be left."""
    T_canonical_sensor = T_sensor_canonical.to(torch.float64).inverse()
    kept = scan[~skirt(T_canonical_sensor.apply_numpy(scan), shape)]
    return kept if len(kept) >= fewest else scan
