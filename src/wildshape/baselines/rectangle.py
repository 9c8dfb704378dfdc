# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines of boxes: a rectangle around one scan, without any model of a vehicle."""

from collections.abc import Callable
from dataclasses import dataclass

import torch

from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.rectangles import l_shape, smallest_rectangle
from wildshape.evaluation.protocol import Spoken
from wildshape.geometry.transforms.rotation import quaternion_from_rotation, rotation_z
from wildshape.records import Box, Points, Sensor


@dataclass(frozen=True)
class Rectangle:
    """A box around each scan; the scan itself is its shape.

    Attributes:
        fit: the upright box around points, sensor frame.
        about: the method in a line.
    """

    fit: Callable[[Points], UprightBox]
    about: str

    def complete(self, points: Points, sensor: Sensor) -> Points:  # noqa: ARG002
        """`points`, unchanged."""
        return points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Spoken]:  # noqa: ARG002
        """Each scan and the box around it."""
        return [Spoken(scan, None, _upright(self.fit(scan))) for scan in scans]


def smallest() -> Rectangle:
    """The rectangle of least area."""
    return Rectangle(smallest_rectangle, "the upright box of least area around the scan")


def fitted_l_shape() -> Rectangle:
    """The rectangle whose sides lie nearest to the points."""
    return Rectangle(l_shape, "the upright box whose sides lie nearest to the scan (L-shape)")


def _upright(found: UprightBox) -> Box:
    turn = rotation_z(torch.tensor(found.yaw, dtype=torch.float64))
    qw, qx, qy, qz = quaternion_from_rotation(turn).tolist()
    size = (found.length, found.width, found.height)
    return Box((found.x, found.y, found.z), size, (qw, qx, qy, qz))
