# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Oriented boxes: the upright one of a complete shape, and the volume that two of them share.

The shared part is convex, whatever the rotations. Its corners are corners of one box inside the
other, and points where an edge of one passes through a face of the other; qhull takes the volume
of their hull.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_z,
)

# A box of edge 2 about the origin; its edges join corners that differ in one coordinate.
SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
EDGES = [(i, j) for i in range(8) for j in range(i) if np.abs(SIGNS[i] - SIGNS[j]).sum() == 2]
_DIRECTIONS = 90  # tried within a quarter turn: one a degree
_TRIM = 0.002  # share of the points left out at each side, for a few strays are far out
_VEHICLE_M = 5.0  # the diagonal of a usual car, metres
_MIRROR = 0.006  # share of the surface at either side that a mirror takes at most
_INSIDE, _FLAT = 1e-9, 1e-12  # of a box's diagonal: rounding


class FittedBox(NamedTuple):
    """A box in the frame of the points it was fitted to.

    Attributes:
        centre: metres.
        size: full lengths along its own x, y, z, metres; x is the longer horizontal one.
        rotation: from box axes to the points' frame, a turn about z.
    """

    centre: Float[Tensor, "3"]
    size: Float[Tensor, "3"]
    rotation: Float[Tensor, "3 3"]


def body_sides(across: Float[np.ndarray, "n"]) -> tuple[float, float]:
    """Right and left end of a vehicle as data sets label it, without its mirrors.

    Args:
        across: y of points spread evenly over its surface, metres.
    """
    low, high = np.quantile(across, (_MIRROR, 1 - _MIRROR))
    return float(low), float(high)


def box_axes(quaternion_wxyz: tuple[float, ...]) -> Float[np.ndarray, "3 3"]:
    """A box's own axes as columns, in the frame that its rotation leads to, float64."""
    held = torch.tensor(quaternion_wxyz, dtype=torch.float64, device="cpu")
    return rotation_from_quaternion(held).numpy()


def fit_box(points: Float[Tensor, "n 3"]) -> FittedBox:
    """The upright rectangle of least area around all but the outermost points at each side.

    Args:
        points: z up, metres.
    """
    angles = torch.arange(_DIRECTIONS, dtype=points.dtype) * (torch.pi / 2 / _DIRECTIONS)
    low, high = _trimmed_range(_along_axes(points, angles))
    across = (high - low)[:-1].view(2, _DIRECTIONS)
    best = int((across[0] * across[1]).argmin())
    axes = torch.tensor((best, _DIRECTIONS + best, 2 * _DIRECTIONS))
    angle, centre, size = angles[best], (low + high)[axes] / 2, (high - low)[axes]
    rotation = rotation_z(angle)
    position = rotation @ centre
    if size[1] > size[0]:
        rotation = rotation_z(angle + torch.pi / 2)
        size = size[torch.tensor((1, 0, 2))]
    if rotation[0, 0] < 0:
        rotation = rotation @ rotation_z(torch.tensor(torch.pi, dtype=points.dtype))
    return FittedBox(position, size, rotation)


def _along_axes(points: Float[Tensor, "n 3"], angles: Float[Tensor, "a"]) -> Tensor:
    """`(2 a + 1, n)`: along x at each angle, along y at each, and along z, which is the same."""
    cos, sin = angles.cos()[:, None], angles.sin()[:, None]
    x, y, z = points.T.contiguous()
    # No matrix product: its rounding depends on a point's place in the order.
    return torch.cat((x * cos + y * sin, y * cos - x * sin, z[None]))


def _trimmed_range(rows: Float[Tensor, "k n"]) -> tuple[Tensor, Tensor]:
    outermost = int(_TRIM * rows.shape[1]) + 1
    low = rows.topk(outermost, dim=1, largest=False).values[:, -1]
    return low, rows.topk(outermost, dim=1).values[:, -1]


def box_iou(a: FittedBox, b: FittedBox) -> float:
    """Intersection over union of two boxes in one frame, 0 to 1."""
    shared = shared_volume(a, b)
    union = float(a.size.prod()) + float(b.size.prod()) - shared
    return shared / union if union > 0 else 0.0


def shared_volume(a: FittedBox, b: FittedBox) -> float:
    """Cubic metres that two boxes in one frame share."""
    # In the axes of `a` and in units of its diagonal: tolerances then mean the same everywhere.
    unit = float(a.size.norm())
    if unit == 0 or float((a.centre - b.centre).norm()) >= (unit + float(b.size.norm())) / 2:
        return 0.0
    half_a, half_b = (box.size.double().numpy() / (2 * unit) for box in (a, b))
    turn = _rotation(a.rotation.double().mT @ b.rotation.double())
    shift = (a.rotation.double().mT @ (b.centre - a.centre).double()).numpy() / unit
    corners_b = SIGNS * half_b @ turn.T + shift
    corners_a = (SIGNS * half_a - shift) @ turn  # seen from b
    from_b = _inside(np.concatenate((corners_b, _through(corners_b, half_a))), half_a)
    from_a = _inside(np.concatenate((corners_a, _through(corners_a, half_b))), half_b)
    return _hull_volume(np.concatenate((from_b, from_a @ turn.T + shift))) * unit**3


def _rotation(nearly: Float[Tensor, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """A product of float32 rotations stretches by 1e-7: of equal boxes no corner were inside."""
    return rotation_from_quaternion(quaternion_from_rotation(nearly)).numpy()


def _through(corners: Float[np.ndarray, "8 3"], half: Float[np.ndarray, "3"]) -> np.ndarray:
    """`(n, 3)`: where a box's edges pass through the planes of another's faces, in its axes."""
    start, end = (corners[[edge[k] for edge in EDGES]] for k in (0, 1))
    faces = np.stack((-half, half))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (faces - start) / (end - start)
    met = (share >= 0) & (share <= 1)
    face, edge, axis = np.nonzero(met)
    points = start[edge] + share[met][:, None] * (end - start)[edge]
    points[np.arange(len(points)), axis] = faces[face, 0, axis]
    return points


def _inside(points: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "3"]) -> np.ndarray:
    return points[(np.abs(points) <= half + _INSIDE).all(1)]


def _hull_volume(points: Float[np.ndarray, "n 3"]) -> float:
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 4 or np.linalg.svd(points - points[0], compute_uv=False)[2] < _FLAT:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # a sliver thinner than qhull can tell from flat
        return 0.0


def unit_of(largest_m: float) -> float:
    """Metres of one unit in which objects of up to that extent are as large as vehicles, at most 1.

    Lengths that a method takes for granted (noise, gaps, how far off a pose may be) are stated for
    vehicles; those of smaller objects are as much smaller.
    """
    return min(1.0, largest_m / _VEHICLE_M)


def extent(points: Float[np.ndarray, "n 3"]) -> float:
    """Diagonal of the axis-aligned bounding box, metres."""
    return float(np.linalg.norm(spans(points)))


def spans(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """Sides of the axis-aligned bounding box, metres.

    `np.ptp` over the rows takes 30 times as long: numpy reduces three numbers at a time.
    """
    columns = np.ascontiguousarray(points.T)
    return columns.max(1) - columns.min(1)
