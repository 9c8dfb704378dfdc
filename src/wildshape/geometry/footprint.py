# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How much of the ground two upright boxes share."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.transforms.se3 import SE3

Place = Float[np.ndarray, "4"]
"""Centre x, y, z and yaw, metres and radians."""


_CORNERS = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) / 2


def upright_places(T_level_box: SE3) -> Float[np.ndarray, "n 4"]:
    """The `Place` of each of `(n,)` boxes, by their poses."""
    yaw = torch.atan2(T_level_box.rotation[:, 1, 0], T_level_box.rotation[:, 0, 0])
    return torch.cat((T_level_box.translation, yaw[:, None]), dim=1).numpy()


def footprint(
    box: Float[np.ndarray, "*n 4"], size: Sequence[float] | Float[np.ndarray, "*n k"]
) -> Float[np.ndarray, "*n 4 2"]:
    """Corners of boxes (centre x, y, z and yaw) seen from above, counter-clockwise.

    Args:
        box: the `Place` of each.
        size: of each, or of all: length and width, and what follows is not read.
    """
    c, s = np.cos(box[..., 3, None]), np.sin(box[..., 3, None])
    along, across = np.moveaxis(_CORNERS * np.asarray(size)[..., None, :2], -1, 0)
    corners = np.stack((c * along - s * across, s * along + c * across), axis=-1)
    return corners + box[..., None, :2]


def shared_grounds(
    box: Float[np.ndarray, "n 4"],
    size: Float[np.ndarray, "n 2"],
    other: Float[np.ndarray, "n 4"],
    other_size: Float[np.ndarray, "n 2"],
) -> Float[np.ndarray, "n"]:
    """Square metres that each of `(n,)` boxes shares in bird's eye view with its other."""
    shared = np.zeros(len(box))
    # Without a side a box is a line or a point, and no point lies outside of that.
    some = np.flatnonzero((size > 0).all(1) & (other_size > 0).all(1))
    if len(some):
        corners = footprint(box[some], size[some]), footprint(other[some], other_size[some])
        shared[some] = _areas(_clipped(*corners))
    return shared


def shared_ground(
    box: Place, size: Sequence[float], other: Place, other_size: Sequence[float]
) -> float:
    """Square metres that two boxes share in bird's eye view; see `footprint`."""
    mine, its = (np.array([one[:2]], float) for one in (size, other_size))
    return float(shared_grounds(box[None], mine, other[None], its)[0])


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


def _clipped(
    polygons: Float[np.ndarray, "n k 2"], by: Float[np.ndarray, "n c 2"]
) -> Float[np.ndarray, "n m 2"]:
    """The part of each polygon inside a convex one (Sutherland and Hodgman 1974).

    All have as many corners: those with fewer have their first one again at the end.
    """
    for start, end in zip(by.swapaxes(0, 1), np.roll(by, -1, axis=1).swapaxes(0, 1)):
        edge, seen = (end - start)[:, None], polygons - start[:, None]
        here = edge[..., 0] * seen[..., 1] - edge[..., 1] * seen[..., 0]
        there, after = np.roll(here, -1, axis=1), np.roll(polygons, -1, axis=1)
        kept = np.stack((here >= 0, here * there < 0), axis=2).reshape(len(here), -1)
        share = np.divide(here, here - there, out=np.zeros_like(here), where=here != there)
        met = polygons + (after - polygons) * share[..., None]
        both = np.stack((polygons, met), axis=2).reshape(len(here), -1, 2)
        order = np.argsort(~kept, axis=1, kind="stable")[:, : kept.sum(1).max(initial=1)]
        polygons = np.take_along_axis(both, order[..., None], axis=1)
        left = np.take_along_axis(kept, order, axis=1)
        polygons = np.where(left[..., None], polygons, polygons[:, :1])
    return polygons


def _areas(polygons: Float[np.ndarray, "n k 2"]) -> Float[np.ndarray, "n"]:
    x, y = np.moveaxis(polygons - polygons[:, :1], -1, 0)
    return np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(1)) / 2
