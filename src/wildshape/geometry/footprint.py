# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How much of the ground two upright boxes share."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.transforms.se3 import SE3

Place = Float[np.ndarray, "4"]
"""Centre x, y, z and yaw, metres and radians."""


def upright_places(T_level_box: SE3) -> Float[np.ndarray, "n 4"]:
    """The `Place` of each of `(n,)` boxes, by their poses."""
    yaw = torch.atan2(T_level_box.rotation[:, 1, 0], T_level_box.rotation[:, 0, 0])
    return torch.cat((T_level_box.translation, yaw[:, None]), dim=1).numpy()


def footprint(box: Place, size: Sequence[float]) -> Float[np.ndarray, "4 2"]:
    """Corners of a box (centre x, y, z and yaw) seen from above, counter-clockwise."""
    c, s = math.cos(box[3]), math.sin(box[3])
    half = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) * np.array(size[:2]) / 2
    return half @ np.array(((c, s), (-s, c))) + np.array(box[:2])


def shared_ground(
    box: Place, size: Sequence[float], other: Place, other_size: Sequence[float]
) -> float:
    """Square metres that two boxes share in bird's eye view; see `footprint`."""
    if not min(*size[:2], *other_size[:2]) > 0:
        return 0.0  # no point is outside of a polygon that is one point
    return _area(_clipped(footprint(box, size), footprint(other, other_size)))


def footprint_overlap(
    box: Place, size: Sequence[float], other: Place, other_size: Sequence[float]
) -> float:
    """The ground that two boxes share, as a part of the smaller one's; see `footprint`."""
    smaller = min(size[0] * size[1], other_size[0] * other_size[1])
    return shared_ground(box, size, other, other_size) / smaller if smaller > 0 else 0.0


def footprint_iou(
    box: Place, size: Sequence[float], other: Place, other_size: Sequence[float]
) -> float:
    """Intersection over union in bird's eye view, 0 to 1; see `footprint`."""
    shared = shared_ground(box, size, other, other_size)
    union = size[0] * size[1] + other_size[0] * other_size[1] - shared
    return shared / union if union > 0 else 0.0


def _clipped(polygon: np.ndarray, by: np.ndarray) -> np.ndarray:
    """The part of a polygon inside a convex one (Sutherland and Hodgman 1974)."""
    for start, end in zip(by, np.roll(by, -1, axis=0)):
        if not len(polygon):
            break
        edge = end - start
        inside = edge[0] * (polygon[:, 1] - start[1]) - edge[1] * (polygon[:, 0] - start[0])
        kept = []
        for i, (a, b) in enumerate(zip(polygon, np.roll(polygon, -1, axis=0))):
            here, there = inside[i], inside[(i + 1) % len(polygon)]
            if here >= 0:
                kept.append(a)
            if here * there < 0:
                kept.append(a + (b - a) * here / (here - there))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def _area(polygon: np.ndarray) -> float:
    if len(polygon) < 3:
        return 0.0
    x, y = (polygon - polygon[0]).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
