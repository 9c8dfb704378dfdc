# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans of which less is seen: something stands before the object, or fewer beams look at it.

Beyond the paper, for self-training: what the whole track showed is taught of such a scan too.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.field_of_view import slope

_BEFORE, _STRIP = 0.2, (0.1, 0.6)
_BESIDE, _SIDE, _LEFT = 0.2, (0.2, 0.7), 0.5
_LOWER, _HIGHER, _FEET = 0.3, 0.1, 0.5
_FEWER, _RING_DEG, _APART_DEG = 0.2, 0.25, (0.7, 2.2)


def partly_hidden(
    points: Float[Tensor, "n 3"], rng: np.random.Generator, fewest: int
) -> Float[Tensor, "n 3"]:
    """The points of a LiDAR scan, or as many points of a part of it.

    In a fifth of the scans a vertical strip is missing, from a pole's width to the better half; in
    a fifth what lies left or right of some direction, up to 70 %; in three of ten whose object
    rises above the sensor's horizon, what lies above some elevation, more often a low one:
    many sensors hardly look up; in one of ten up to the lower half, behind something low; of a
    fifth there are rings of beams alone, as far apart as a sensor of sixteen to fifty has them.

    Args:
        points: sensor frame, z up.
        rng: decides.
        fewest: points that have to be left; else the scan stays as it is.
    """
    kept = torch.ones(len(points), dtype=torch.bool)
    if rng.random() < _BEFORE:
        kept &= ~_strip(points, rng)
    if rng.random() < _BESIDE:
        kept &= _one_side(points, rng)
    if rng.random() < _LOWER:
        slopes = slope(points)
        kept &= slopes <= max(rng.uniform(0.0, 1.0) ** 2 * float(slopes.max()), 0.0)
    if rng.random() < _HIGHER:
        kept &= _elevation_place(points) >= rng.uniform(0.0, _FEET)
    if rng.random() < _FEWER:
        kept &= _rings(points, rng)
    rows = torch.nonzero(kept)[:, 0]
    if len(rows) < fewest or len(rows) == len(points):
        return points
    return points[rows[torch.from_numpy(rng.integers(len(rows), size=len(points)))]]


def _strip(points: Float[Tensor, "n 3"], rng: np.random.Generator) -> Bool[Tensor, "n"]:
    """Points between two directions of the ground plane."""
    place = _azimuth_place(points)
    width = rng.uniform(*_STRIP)
    start = rng.uniform(0.0, 1.0) - width / 2
    return (place >= start) & (place <= start + width)


def _one_side(points: Float[Tensor, "n 3"], rng: np.random.Generator) -> Bool[Tensor, "n"]:
    """Points left, or right, of a direction of the ground plane."""
    hidden = rng.uniform(*_SIDE)
    place = _azimuth_place(points)
    return place <= 1 - hidden if rng.random() < _LEFT else place >= hidden


def _azimuth_place(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
    """0 where the scan ends to the right, 1 where it ends to the left."""
    ahead = points[:, :2].mean(0)
    along = points[:, :2] @ ahead
    across = points[:, 1] * ahead[0] - points[:, 0] * ahead[1]
    azimuth = torch.atan2(across, along)
    low, high = float(azimuth.min()), float(azimuth.max())
    return (azimuth - low) / max(high - low, 1e-9)


def _elevation_place(points: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
    """0 where the scan's lowest elevation is, 1 at its highest."""
    slopes = slope(points)
    low, high = float(slopes.min()), float(slopes.max())
    return (slopes - low) / max(high - low, 1e-9)


def _rings(points: Float[Tensor, "n 3"], rng: np.random.Generator) -> Bool[Tensor, "n"]:
    """Points of beams at even elevations, a quarter of a degree high each."""
    apart = rng.uniform(*_APART_DEG)
    elevation = torch.rad2deg(torch.atan(slope(points)))
    return (elevation - rng.uniform(0.0, apart)).remainder(apart) < _RING_DEG
