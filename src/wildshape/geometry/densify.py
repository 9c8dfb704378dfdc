# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Twice as many points as a network gives: middles between its own, then what the scans saw.

Beyond the paper. A decoder's points lie unevenly and miss what is small: mirrors, bumpers, the
edges of roofs. The scans in hand have points there.
"""

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from wildshape.geometry.sampling import thin, voxel_thin
from wildshape.geometry.surface import gathered, is_mirrored
from wildshape.ops.nearest import nearest, nearest_k

_SMALLEST_M = 1e-6
Points = Float32[np.ndarray, "_ 3"]
_REFLECTED = np.array((1, -1, 1), np.float32)


def partners(points: Float[Tensor, "B P 3"], count: int) -> Tensor:
    """`(B, P)`: the place of each point's `count`th neighbour."""
    whole, size = points.float(), points.shape[1]
    if not is_mirrored(points):
        return nearest_k(whole, whole, count + 1).index[..., count]
    found = nearest_k(whole[:, : size // 2], whole, count + 1).index[..., count]
    return torch.cat((found, (found + size // 2) % size), dim=1)


def denser(points: Float[Tensor, "B P 3"], partner: Int64[Tensor, "B P"]) -> Tensor:
    """`(B, 2 P, 3)`: the points, then the middles between each one and its partner."""
    return torch.cat((points, (points + gathered(points, partner)) / 2), dim=1)


def with_exact(middles: Points, shape: Points, seen: Points, *, mirror: bool) -> Points:
    """Middles of a shape but where it was seen, and there what was: for scans without noise.

    Where scans, dense and exact as a depth camera's, saw something, their points, as far apart as
    the shape's, stand in for the middles. What was seen of one side of a symmetric shape is known
    of the other.

    Args:
        middles: what `denser` added, canonical frame.
        shape: the shape's own points, the same frame.
        seen: points of its scans, the same frame.
        mirror: the shape is symmetric to y = 0.
    """
    points = torch.from_numpy(np.concatenate((shape, middles)))[None]
    apart = nearest_k(points, points, 2).distance_squared[0, :, 1].sqrt()
    gap = max(float(apart.median()), _SMALLEST_M)
    seen = np.concatenate((seen, seen * _REFLECTED)) if mirror else seen
    unseen = middles[_apart(middles, seen) > gap]
    return np.concatenate((unseen, voxel_thin(seen, gap))).astype(middles.dtype)


def with_seen(
    middles: Points,
    shape: Points,
    seen: Points,
    *,
    mirror: bool,
    voxel: float,
    near: float,
) -> Points:
    """Middles of a shape, of which those nearest to what was seen make room for it.

    For LiDARs: their scans have noise and gaps, so the shape's own points stay, and what lies far
    from all of them is not believed. What was seen of one side of a symmetric shape is known of the
    other.

    Args:
        middles: what `denser` added, canonical frame.
        shape: the shape's own points, the same frame.
        seen: points of its scans, the same frame.
        mirror: the second half of the points is the first one's reflection in y = 0.
        voxel: what was seen is thinned to this.
        near: what lies farther from the shape is not believed.

    Returns:
        As many points as `middles`.
    """
    kept = middles[: len(middles) // 2] if mirror else middles
    shown = voxel_thin(_one_side(seen) if mirror else seen, voxel)
    shown = shown[_apart(shown, shape) < near]
    shown = thin(shown, len(kept))
    if not len(shown):
        return middles
    order = np.argsort(_apart(_one_side(kept) if mirror else kept, shown), kind="stable")
    some = np.concatenate((kept[np.sort(order[len(shown) :])], shown))
    return np.concatenate((some, some * _REFLECTED)) if mirror else some


def _one_side(points: Points) -> Points:
    """The points, those right of y = 0 reflected."""
    return np.stack((points[:, 0], np.abs(points[:, 1]), points[:, 2]), axis=1)


def _apart(points: Points, others: Points) -> Float[np.ndarray, "n"]:
    """How far each point is from the nearest of the others."""
    found = nearest(torch.from_numpy(points)[None], torch.from_numpy(others)[None])
    return found.distance_squared[0].sqrt().numpy()
