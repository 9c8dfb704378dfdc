# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Overlap of upright boxes, seen from above and in space."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from wildshape.geometry.footprint import shared_grounds

_PLACE, _SIDES, _Z, _HEIGHT = [0, 1, 2, 6], [3, 4], 2, 5  # columns of an `UprightBox`


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


class Overlaps(NamedTuple):
    """Of each found box with each labelled one; few of the pairs meet, and these alone are held.

    Attributes:
        shape: how many are found, how many labelled.
        pairs: rows and columns of the pairs that are near each other.
        parts: `(3, k)` of each of them: `bev`, `space` and `on`.
    """

    shape: tuple[int, int]
    pairs: tuple[np.ndarray, np.ndarray]
    parts: Float[np.ndarray, "3 k"]

    @property
    def bev(self) -> Float[np.ndarray, "f l"]:
        """Intersection over union in bird's eye view; made anew each time."""
        return self._table(0)

    @property
    def space(self) -> Float[np.ndarray, "f l"]:
        """Intersection over union in 3D."""
        return self._table(1)

    @property
    def on(self) -> Float[np.ndarray, "f l"]:
        """The part of the found box's footprint that lies on the label's."""
        return self._table(2)

    def _table(self, which: int) -> Float[np.ndarray, "f l"]:
        table = np.zeros(self.shape)
        table[self.pairs] = self.parts[which]
        return table


def overlaps(found: Sequence[UprightBox], labelled: Sequence[UprightBox]) -> Overlaps:
    """All pairs."""
    a, b = (np.array(boxes, float).reshape(-1, 7) for boxes in (found, labelled))
    i, j = _near(a, b)
    one, other = a[i], b[j]
    shared = shared_grounds(one[:, _PLACE], one[:, _SIDES], other[:, _PLACE], other[:, _SIDES])
    areas = one[:, _SIDES].prod(1), other[:, _SIDES].prod(1)
    tops, floors = (
        [boxes[:, _Z] + half * boxes[:, _HEIGHT] for boxes in (one, other)] for half in (0.5, -0.5)
    )
    volume = shared * np.maximum(np.minimum(*tops) - np.maximum(*floors), 0.0)
    volumes = areas[0] * one[:, _HEIGHT] + areas[1] * other[:, _HEIGHT]
    bev = _part(shared, areas[0] + areas[1] - shared)
    parts = np.stack((bev, _part(volume, volumes - volume), _part(shared, areas[0])))
    return Overlaps((len(a), len(b)), (i, j), parts)


def _near(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs whose circumscribed circles meet: few of all."""
    reach = [np.linalg.norm(boxes[:, _SIDES], axis=1) / 2 for boxes in (a, b)]
    apart = np.hypot(*(a[:, None, :2] - b[None, :, :2]).transpose(2, 0, 1))
    i, j = np.nonzero(apart < reach[0][:, None] + reach[1])
    return i, j


def _part(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """0 of what has no extent."""
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
