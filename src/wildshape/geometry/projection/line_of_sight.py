# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scan seen along its own line of sight (beyond the paper).

Every scan is taken from the origin, so the direction in which an object lies needs no label. Turned
so that the object lies straight ahead, scans that differ by a turn of the sensor about its vertical
become the same scan, and of a free rotation nothing is left but the roll about the line of sight.
So it is worth knowing whether a sensor can have stood at the origin at all.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.box import extent
from wildshape.geometry.projection.visibility import facing_rotation

_AHEAD, _SMALLEST_M, _NOWHERE = (1.0, 0.0, 0.0), 1e-6, 1e-9
_STEPS = 200
_NEAR = 0.01  # of the extent: no sensor comes as near to the hull of what it sees
# Axes x forward, y left, z up of a depth camera's own x right, y down, z forward.
_CAMERA = ((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0))


class Facing(NamedTuple):
    """How one scan is turned and centred.

    Attributes:
        turn: `R_facing_sensor`: x along the mean direction of the points, z as far up as can be,
            where up is z of a LiDAR and -y of a depth camera.
        centre: on that line of sight, at the middle of the ranges; turned frame, metres.
    """

    turn: Float[Tensor, "*batch 3 3"]
    centre: Float[Tensor, "*batch 3"]


def face(
    points: Float[Tensor, "*batch n 3"],
    counted: Bool[Tensor, "*batch n"] | None = None,
    *,
    sensor_kind: str = "lidar",
) -> Facing:
    """The facing frame of a scan, sensor frame, none of its points at the sensor itself.

    Turns of the sensor change the roll of the frame about the line of sight, and nothing else.

    Args:
        points: of one scan or of many.
        counted: which of them the scan has; others repeat one of those. All by default.
        sensor_kind: `lidar` or `camera`: says which way is up.
    """
    distance, unit = _seen(points)
    if counted is not None:
        unit = unit * counted[..., None]
    middle = (distance.amin(-1) + distance.amax(-1)) / 2
    turn = _towards(unit.mean(-2).reshape(-1, 3), sensor_kind).view(*middle.shape, 3, 3)
    centre = middle[..., None] * distance.new_tensor(_AHEAD)
    return Facing(turn.to(points.dtype), centre.to(points.dtype))


def face_each(scans: Sequence[Float[Tensor, "_ 3"]], sensor_kind: str = "lidar") -> Facing:
    """`face` of scans of different sizes, with few operations a scan."""
    distance, unit = _seen(torch.cat(list(scans)))
    sizes = [len(scan) for scan in scans]
    ranges = [part.aminmax() for part in distance.split(sizes)]
    middle = torch.stack([(nearest + farthest) / 2 for nearest, farthest in ranges])
    turn = _towards(torch.stack([part.mean(0) for part in unit.split(sizes)]), sensor_kind)
    centre = middle[:, None] * distance.new_tensor(_AHEAD)
    return Facing(turn.to(scans[0].dtype), centre.to(scans[0].dtype))


def _seen(points: Float[Tensor, "*batch 3"]) -> tuple[Tensor, Tensor]:
    """Distance `(*batch)` and direction `(*batch 3)` of points from the sensor, float64."""
    exact = points.double()
    distance = exact.norm(dim=-1)
    return distance, exact / distance[..., None].clamp_min(_SMALLEST_M)


def _towards(direction: Float[Tensor, "B 3"], sensor_kind: str) -> Float[Tensor, "B 3 3"]:
    """Rotation that turns `direction` to +x, up as far up as can be.

    Of points all around the sensor there is none: they are turned as if they lay ahead.
    """
    if sensor_kind == "lidar":
        return facing_rotation(_somewhere(direction))
    axes = direction.new_tensor(_CAMERA)
    return facing_rotation(_somewhere(direction @ axes.mT)) @ axes


def _somewhere(direction: Float[Tensor, "B 3"]) -> Float[Tensor, "B 3"]:
    """The direction, or ahead if it is none but for rounding."""
    ahead = torch.zeros_like(direction)
    ahead[..., 0] = (direction.norm(dim=-1) < _NOWHERE).to(direction.dtype)
    return direction + ahead


def roll(angle: Float[Tensor, "B"]) -> Float[Tensor, "B 3 3"]:
    """Rotations about x, the line of sight; radians, right-handed."""
    cosine, sine = torch.cos(angle), torch.sin(angle)
    zero, one = torch.zeros_like(angle), torch.ones_like(angle)
    rows = (one, zero, zero, zero, cosine, -sine, zero, sine, cosine)
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


def roll_angle(R_facing_object: Float[Tensor, "B 3 3"]) -> Float[Tensor, "B"]:
    """The angle to `roll` by so that the object's z axis points up beside the line of sight."""
    up = R_facing_object[:, :, 2]
    return torch.atan2(up[:, 1], up[:, 2])


def surrounded(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points lie on all sides of the origin: in their convex hull, or as good as.

    Frank-Wolfe steps to the hull's point nearest to the origin. As soon as all points lie before
    a plane through the origin it is outside; for a real scan that is seen at the first step.
    """
    exact = points.astype(np.float64)
    reach = _NEAR * extent(exact)
    place = exact.mean(0)
    for _ in range(_STEPS):
        if float(place @ place) <= reach**2:
            return True
        ahead = exact @ place
        back = exact[int(ahead.argmin())]
        if float(ahead.min()) > 0.0:
            return False
        step = place - back
        place = place - step * min(1.0, float(place @ step) / float(step @ step))
    return False
