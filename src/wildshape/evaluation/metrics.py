# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of METHOD 8: Euclidean, not squared, not halved; metres and degrees."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.box import FittedBox, body_sides, box_iou
from wildshape.geometry.footprint import footprint_iou
from wildshape.geometry.transforms.rotation import rotation_from_quaternion, rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.ops.nearest import nearest_both, nearest_distance
from wildshape.records import Box, Points

ACCURATE_DEG = 30.0


@dataclass(frozen=True)
class CompletionError:
    """How far a completed cloud is from the true surface.

    Attributes:
        precision: mean distance prediction -> truth, metres.
        coverage: mean distance truth -> prediction, metres.
    """

    precision: float
    coverage: float

    @property
    def cd(self) -> float:
        """Chamfer distance, `precision + coverage`."""
        return self.precision + self.coverage


def completion_error(predicted: Points, truth: Points) -> CompletionError:
    """The whole predicted cloud `(m, 3)` against the truth `(g, 3)` in the same frame.

    Raises:
        BadInputError: one of them has no points.
    """
    if not (len(predicted) and len(truth)):
        raise BadInputError("a cloud without points has no distance; check what made it.")
    # Near the origin float32 keeps its digits; distances do not care where the origin is.
    origin = truth.mean(axis=0, dtype=float)
    a = torch.as_tensor((predicted - origin)[None], dtype=torch.float32)
    b = torch.as_tensor((truth - origin)[None], dtype=torch.float32)
    to_truth, to_predicted = nearest_both(a, b)
    precision = nearest_distance(a, b, to_truth).double().mean()
    coverage = nearest_distance(b, a, to_predicted).double().mean()
    return CompletionError(float(precision), float(coverage))


@dataclass(frozen=True)
class RegistrationError:
    """One entry a scan.

    Attributes:
        rotation_deg: angle between predicted and true rotation, 0 to 180.
        rotation_sym_deg: the smaller of that and the angle to the truth turned half about the
            object's own z axis: a car front to back.
        translation_m: how far the object's true origin, carried by the predicted transform, lands
            from where it belongs.
    """

    rotation_deg: Float[Tensor, "V"]
    rotation_sym_deg: Float[Tensor, "V"]
    translation_m: Float[Tensor, "V"]


@dataclass(frozen=True)
class RegistrationScore:
    """One scan registered to its track's middle scan: its names, and `RegistrationError`."""

    track: str
    scan: str
    rotation_deg: float
    rotation_sym_deg: float
    translation_m: float


def registration_error(
    T_middle_scan: SE3, T_sensor_object: SE3, T_middle_object: SE3
) -> RegistrationError:
    """Errors of predicted transforms.

    Args:
        T_middle_scan: predicted, one a scan.
        T_sensor_object: true poses of the same scans.
        T_middle_object: true pose of the middle scan.
    """
    half_turn = SE3(
        rotation_z(torch.tensor(math.pi, dtype=torch.float64)), torch.zeros(3, dtype=torch.float64)
    )
    T_object_scan = T_sensor_object.inverse()
    error = T_middle_scan.inverse() @ T_middle_object @ T_object_scan
    flipped = T_middle_scan.inverse() @ T_middle_object @ half_turn @ T_object_scan
    rotation = torch.rad2deg(error.angle())
    landed = T_middle_scan @ T_sensor_object
    return RegistrationError(
        rotation_deg=rotation,
        rotation_sym_deg=torch.minimum(rotation, torch.rad2deg(flipped.angle())),
        translation_m=(landed.translation - T_middle_object.translation).norm(dim=-1),
    )


def hull_area(points: Points) -> float:
    """Area of the convex hull, square metres: about a car's own surface (flat clouds: twice it).

    0 of fewer than four points, which have none.
    """
    from scipy.spatial import ConvexHull

    if len(points) < 4:
        return 0.0
    # QJ: joggled input, so that flat clouds have a hull too; its random numbers have a fixed seed.
    return float(ConvexHull(np.asarray(points, dtype=float), qhull_options="QJ").area)


def distance_floor(area: float, count: int) -> float:
    """One side of CD of perfect points: `count` drawn at random on `area` (METHOD 8).

    Evenly spread points come nearer: to 0.38 where these are at 0.5.
    """
    return 0.5 * math.sqrt(area / count)


@dataclass(frozen=True)
class BoxScore:
    """One predicted box.

    Attributes:
        iou: shared over joint volume, 0 to 1, both boxes as they stand in space.
        heading_deg: turn about the object's vertical from the box's x to the object's, 0 to 180.
        bev: shared over joint area seen from above the object, 0 to 1.
        length_off_m: by how much it is longer than the true one.
        width_off_m: wider.
        height_off_m: higher.
    """

    iou: float
    heading_deg: float
    bev: float = 0.0
    length_off_m: float = 0.0
    width_off_m: float = 0.0
    height_off_m: float = 0.0

    @property
    def heading_sym_deg(self) -> float:
        """The same if half turns are forgiven, 0 to 90."""
        return min(self.heading_deg, 180 - self.heading_deg)


def true_box(shape: Points, *, body: bool = False) -> FittedBox:
    """The tight box of a true shape, object frame, its axes those of that frame.

    Args:
        shape: spread evenly over the surface.
        body: of a vehicle as data sets label it, without its mirrors.
    """
    points = torch.from_numpy(shape).double()
    low, high = points.amin(0), points.amax(0)
    if body:
        low[1], high[1] = body_sides(shape[:, 1].astype(np.float64))
    return FittedBox((low + high) / 2, high - low, torch.eye(3, dtype=torch.float64))


def box_score(predicted: Box, truth: FittedBox, T_sensor_object: SE3) -> BoxScore:
    """A box of the sensor frame against the true one of the object frame."""
    T_object_sensor = T_sensor_object.to(torch.float64).inverse()
    centre, size, wxyz = (
        torch.tensor(part, dtype=torch.float64)
        for part in (predicted.centre, predicted.size, predicted.quaternion_wxyz)
    )
    rotation = T_object_sensor.rotation @ rotation_from_quaternion(wxyz)
    found = FittedBox(T_object_sensor.apply(centre[None])[0], size, rotation)
    x, y = rotation[:2, 0].tolist()
    yaw = math.atan2(y, x)
    places = (np.array((*one.centre.tolist(), turn)) for one, turn in ((found, yaw), (truth, 0.0)))
    place, true_place = places
    bev = footprint_iou(place, found.size.tolist(), true_place, truth.size.tolist())
    length, width, height = (found.size - truth.size).tolist()
    return BoxScore(
        iou=box_iou(found, truth),
        heading_deg=abs(math.degrees(yaw)),
        bev=bev,
        length_off_m=length,
        width_off_m=width,
        height_off_m=height,
    )


def labelled_box(size_m: tuple[float, float, float]) -> FittedBox:
    """The labelled box of an object, whose frame has its origin at the box's centre."""
    size = torch.tensor(size_m, dtype=torch.float64)
    return FittedBox(torch.zeros_like(size), size, torch.eye(3, dtype=torch.float64))
