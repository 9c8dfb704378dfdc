# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Overlap of upright boxes, seen from above and in space."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from wildshape.geometry.footprint import Place, shared_ground


class UprightBox(NamedTuple):
    """A box that stands upright in the sensor frame, metres and radians.

    Attributes:
        x: of its centre.
        y: see x.
        z: see x.
        length: along its heading.
        width: across.
        height: upward.
        yaw: heading about z, 0 along x.
    """

    x: float
    y: float
    z: float
    length: float
    width: float
    height: float
    yaw: float

    @property
    def area(self) -> float:
        """Of its footprint, square metres."""
        return self.length * self.width


class Overlaps(NamedTuple):
    """Of each found box with each labelled one, `(f, l)`.

    Attributes:
        bev: intersection over union in bird's eye view.
        space: intersection over union in 3D.
        on: the part of the found box's footprint that lies on the label's.
    """

    bev: Float[np.ndarray, "f l"]
    space: Float[np.ndarray, "f l"]
    on: Float[np.ndarray, "f l"]


def overlaps(found: Sequence[UprightBox], labelled: Sequence[UprightBox]) -> Overlaps:
    """All pairs."""
    bev, space, on = np.zeros((3, len(found), len(labelled)))
    for i, one in enumerate(found):
        for j, other in enumerate(labelled):
            shared = shared_area(one, other)
            if shared > 0:
                bev[i, j] = shared / (one.area + other.area - shared)
                on[i, j] = shared / one.area
                space[i, j] = _space(one, other, shared)
    return Overlaps(bev, space, on)


def shared_area(a: UprightBox, b: UprightBox) -> float:
    """Square metres of ground that two boxes share."""
    reach = (math.hypot(a.length, a.width) + math.hypot(b.length, b.width)) / 2
    if math.hypot(a.x - b.x, a.y - b.y) >= reach:
        return 0.0
    return shared_ground(_place(a), (a.length, a.width), _place(b), (b.length, b.width))


def _place(box: UprightBox) -> Place:
    return np.array((box.x, box.y, box.z, box.yaw))


def _space(a: UprightBox, b: UprightBox, area: float) -> float:
    top = min(a.z + a.height / 2, b.z + b.height / 2)
    shared = area * max(top - max(a.z - a.height / 2, b.z - b.height / 2), 0.0)
    return shared / (a.area * a.height + b.area * b.height - shared)
