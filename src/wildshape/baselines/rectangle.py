# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines of boxes: a rectangle around one scan, without any model of a vehicle."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.rectangles import l_shape, smallest_rectangle
from wildshape.evaluation.protocol import Spoken
from wildshape.geometry.transforms.rotation import quaternion_from_rotation, rotation_z
from wildshape.records import Box, Points, Sensor

_R_LEVEL_CAMERA = np.array(((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)))
"""A camera's x right, y down, z forward to a LiDAR's x forward, y left, z up."""


@dataclass(frozen=True)
class Rectangle:
    """A box around each scan; the scan itself is its shape.

    Attributes:
        fit: the upright box around points, z up.
        about: the method in a line.
    """

    fit: Callable[[Points], UprightBox]
    about: str

    def complete(self, points: Points, sensor: Sensor) -> Points:  # noqa: ARG002
        """`points`, unchanged."""
        return points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Spoken]:
        """Each scan and the box around it; cameras are taken to be level."""
        turn = _R_LEVEL_CAMERA if sensor.kind == "camera" else np.eye(3)
        fits = [self.fit(scan @ turn.T.astype(scan.dtype)) for scan in scans]
        return [Spoken(scan, None, _box(fit, turn.T)) for scan, fit in zip(scans, fits)]


def smallest() -> Rectangle:
    """The rectangle of least area."""
    return Rectangle(smallest_rectangle, "the upright box of least area around the scan")


def fitted_l_shape() -> Rectangle:
    """The rectangle whose sides lie nearest to the points."""
    return Rectangle(l_shape, "the upright box whose sides lie nearest to the scan (L-shape)")


def _box(found: UprightBox, R_sensor_level: np.ndarray) -> Box:
    back = torch.from_numpy(R_sensor_level)
    turn = back @ rotation_z(torch.tensor(found.yaw, dtype=torch.float64))
    qw, qx, qy, qz = quaternion_from_rotation(turn).tolist()
    x, y, z = (R_sensor_level @ (found.x, found.y, found.z)).tolist()
    return Box((x, y, z), (found.length, found.width, found.height), (qw, qx, qy, qz))
