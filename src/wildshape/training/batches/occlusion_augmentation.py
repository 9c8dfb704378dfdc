# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans of which less is seen: something stands before the object, or fewer beams look at it.

Beyond the paper, for self-training: what the whole track showed is taught of such a scan too.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.field_of_view import slope


@dataclass(frozen=True)
class OcclusionConfig:
    """How often a part of a LiDAR scan is taken away, and how much; each kind by itself.

    Attributes:
        strip: share of the scans in which something stands before the object.
        strip_width: of the scan's azimuths that it hides: from a pole to the better half.
        side: share of the scans of which one side is hidden.
        side_width: of the scan's azimuths that are hidden then.
        left: share of those of which the left side is hidden.
        top: share of the scans, of objects that rise above the sensor's horizon, that are cut at
            some elevation, more often a low one: many sensors hardly look up.
        feet: share of the scans of which something low hides the feet.
        feet_height: most of the scan's elevations that are hidden then.
        rings: share of the scans that are thinned to rings of beams.
        ring_deg: height of a ring.
        ring_apart_deg: of rings, as of sensors of fifty to sixteen beams.
        least: share of a scan that has to be left; else it stays as it is.
    """

    strip: float = 0.2
    strip_width: tuple[float, float] = (0.1, 0.6)
    side: float = 0.2
    side_width: tuple[float, float] = (0.2, 0.7)
    left: float = 0.5
    top: float = 0.3
    feet: float = 0.1
    feet_height: float = 0.5
    rings: float = 0.2
    ring_deg: float = 0.25
    ring_apart_deg: tuple[float, float] = (0.7, 2.2)
    least: float = 0.1


_DEFAULT = OcclusionConfig()


class PartlyHidden(NamedTuple):
    """A scan of which less is seen.

    Attributes:
        points: as many as before, of the part that is seen.
        hidden: the points before which something stands now.
    """

    points: Float[Tensor, "n 3"]
    hidden: Float[Tensor, "h 3"]


def partly_hidden(
    points: Float[Tensor, "n 3"],
    rng: np.random.Generator,
    config: OcclusionConfig = _DEFAULT,
) -> PartlyHidden:
    """A LiDAR scan, or as many points of a part of it.

    What the sensor does not look at, above its field of view and between its beams, is gone and not
    hidden.

    Args:
        points: sensor frame, z up.
        rng: decides.
        config: how often what is hidden.
    """
    looked_at = torch.ones(len(points), dtype=torch.bool)
    open_to_view = looked_at.clone()
    if rng.random() < config.strip:
        open_to_view &= ~_strip(points, rng, config)
    if rng.random() < config.side:
        open_to_view &= _one_side(points, rng, config)
    if rng.random() < config.top:
        slopes = slope(points)
        looked_at &= slopes <= max(rng.uniform(0.0, 1.0) ** 2 * float(slopes.max()), 0.0)
    if rng.random() < config.feet:
        open_to_view &= _elevation_place(points) >= rng.uniform(0.0, config.feet_height)
    if rng.random() < config.rings:
        looked_at &= _rings(points, rng, config)
    rows = torch.nonzero(looked_at & open_to_view)[:, 0]
    if len(rows) < config.least * len(points) or len(rows) == len(points):
        return PartlyHidden(points, points[:0])
    kept = points[rows[torch.from_numpy(rng.integers(len(rows), size=len(points)))]]
    return PartlyHidden(kept, points[looked_at & ~open_to_view])


def _strip(
    points: Float[Tensor, "n 3"], rng: np.random.Generator, config: OcclusionConfig
) -> Bool[Tensor, "n"]:
    """Points between two directions of the ground plane."""
    place = _azimuth_place(points)
    width = rng.uniform(*config.strip_width)
    start = rng.uniform(0.0, 1.0) - width / 2
    return (place >= start) & (place <= start + width)


def _one_side(
    points: Float[Tensor, "n 3"], rng: np.random.Generator, config: OcclusionConfig
) -> Bool[Tensor, "n"]:
    """Points left, or right, of a direction of the ground plane."""
    hidden = rng.uniform(*config.side_width)
    place = _azimuth_place(points)
    return place <= 1 - hidden if rng.random() < config.left else place >= hidden


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


def _rings(
    points: Float[Tensor, "n 3"], rng: np.random.Generator, config: OcclusionConfig
) -> Bool[Tensor, "n"]:
    """Points of beams at even elevations."""
    apart = rng.uniform(*config.ring_apart_deg)
    elevation = torch.rad2deg(torch.atan(slope(points)))
    return (elevation - rng.uniform(0.0, apart)).remainder(apart) < config.ring_deg
