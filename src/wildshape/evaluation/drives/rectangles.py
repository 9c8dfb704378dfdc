# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines: a box around the points of a cluster, without any model of a vehicle."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.records import Points

_ANGLES = np.radians(np.arange(0.0, 90.0))
_MOST, _NEAREST_M, _THINNEST_M = 2000, 0.01, 0.05
Criterion = Callable[[np.ndarray, np.ndarray], np.ndarray]


def smallest_rectangle(points: Points) -> UprightBox:
    """The upright box whose footprint has the least area, of headings a degree apart."""
    return _best(points, lambda along, across: -np.ptp(along, axis=0) * np.ptp(across, axis=0))


def l_shape(points: Points) -> UprightBox:
    """The upright box whose sides lie nearest to the points.

    The closeness criterion of Zhang et al., "Efficient L-Shape Fitting for Vehicle Detection Using
    Laser Scanners", IV 2017, algorithm 4.
    """
    return _best(points, _closeness)


def _closeness(along: np.ndarray, across: np.ndarray) -> np.ndarray:
    nearest = np.minimum(_to_side(along), _to_side(across))
    return (1.0 / np.maximum(nearest, _NEAREST_M)).sum(0)


def _to_side(values: Float[np.ndarray, "n a"]) -> np.ndarray:
    """Distances to the end of the extent that is nearer on the whole."""
    low, high = values - values.min(0), values.max(0) - values
    return np.where(np.linalg.norm(high, axis=0) < np.linalg.norm(low, axis=0), high, low)


def _best(points: Points, worth: Criterion) -> UprightBox:
    """The rectangle of the best of all headings; its longer side is its length."""
    xy = points[:: 1 + len(points) // _MOST, :2].astype(np.float64)
    cos, sin = np.cos(_ANGLES), np.sin(_ANGLES)
    yaw = float(_ANGLES[worth(xy @ (cos, sin), xy @ (-sin, cos)).argmax()])
    turn = np.array(((np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))))
    flat = points[:, :2].astype(np.float64) @ turn
    low, high = flat.min(0), flat.max(0)
    x, y = turn @ ((low + high) / 2)
    length, width = np.maximum(high - low, _THINNEST_M)
    bottom, top = float(points[:, 2].min()), float(points[:, 2].max())
    tall = max(top - bottom, _THINNEST_M)
    if width > length:
        length, width, yaw = width, length, yaw + np.pi / 2
    return UprightBox(
        float(x), float(y), (bottom + top) / 2, float(length), float(width), tall, yaw
    )
