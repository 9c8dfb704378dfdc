# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What points must be to be a scan of one object, in metres, by a sensor at the origin."""

import math

import numpy as np
from jaxtyping import Bool, Float

from wildshape.errors import BadInputError

LEAST_POINTS = 16
"""Finite points that a scan has at least."""
_LARGEST_EXTENT = 100.0
_SMALLEST_EXTENT = 0.01
_FARTHEST = 1000.0
_ENOUGH = 10_000  # points that tell where a scan lies


def without_repeats(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Each place once, in the order of the first: what a file repeats was not seen twice.

    Args:
        points: finite; the same array comes back where no place is repeated.
    """
    by_x = np.sort(points[:, 0])
    if not (by_x[1:] == by_x[:-1]).any():
        return points
    order = np.lexsort(points.T)  # stable: of equal places the first comes first
    placed = points[order]
    again = np.append(False, (placed[1:] == placed[:-1]).all(axis=1))
    return points[np.sort(order[~again])] if again.any() else points


def check_scan(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse what cannot be a scan of one object in metres, taken by a sensor at the origin.

    Args:
        points: `(n, 3)`, metres, in the precision of the file.
        name: the file, for the error.

    Raises:
        BadInputError: fewer than 16 finite, different points, all points equal, an extent (the
            longest side of the bounding box) over 100 m or under 1 cm, or farther than 1 km away.
    """
    if not len(points):
        raise BadInputError(
            f"{name}: is empty but for its header (0 finite points); write the scan again."
        )
    points = only_finite(points)
    if len(points) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; a scan needs at least {LEAST_POINTS}: "
            "use a denser one."
        )
    extent = _extent(points)
    if extent == 0.0:
        raise BadInputError(
            f"{name}: all {len(points)} points are equal; the file was written wrongly or "
            "is no scan."
        )
    check_one_object(points, name)
    check_repeats(points, name)
    check_near(points, name)


def check_repeats(points: Float[np.ndarray, "n 3"], name: str) -> Float[np.ndarray, "k 3"]:
    """Each place once; a few places are refused, however often they are repeated.

    Raises:
        BadInputError: fewer than 16 different points.
    """
    places = without_repeats(points)
    if len(places) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} points in {len(places)} places; a scan needs at least"
            f" {LEAST_POINTS}: use a denser one."
        )
    return places


def check_one_object(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse a scene, and units that are no metres.

    Args:
        points: `(n, 3)`, finite, metres.
        name: the file, for the error.

    Raises:
        BadInputError: they are over 100 m or under 1 cm across.
    """
    extent = _extent(points)
    if extent < _SMALLEST_EXTENT:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at least "
            f"{_SMALLEST_EXTENT:g} m: "
            "normalised coordinates (write them in metres), or a unit that does not fit "
            "(drop --unit mm if the file is in metres)."
        )
    if extent > _LARGEST_EXTENT:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at most "
            f"{_LARGEST_EXTENT:g} m: "
            "coordinates in millimetres (then pass --unit mm or cm) or degrees, or a whole scene "
            "(then cut the object out first)."
        )


def _extent(points: Float[np.ndarray, "n 3"]) -> float:
    """The longest side of the bounding box, metres."""
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    return float((high - low).max())


def check_near(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse what no sensor at the origin saw, and what float32 could not hold to a millimetre.

    Args:
        points: `(n, 3)`, metres, in the precision of the file.
        name: the file, for the error.

    Raises:
        BadInputError: the points lie farther than 1 km from the origin.
    """
    points = only_finite(points)
    if not len(points):
        return
    points = points[:: 1 + len(points) // _ENOUGH]
    with np.errstate(over="ignore"):  # infinitely far is farther
        away = math.hypot(*(float(np.median(axis)) for axis in points.T))
    if away > _FARTHEST:
        raise BadInputError(
            f"{name}: lies {away:.5g} m from the origin, but a scan is in its sensor's frame,"
            f" within {_FARTHEST:g} m of it: coordinates of a map (then subtract the sensor's"
            " position there in float64; commands on objects do so with --origin X,Y,Z) or in"
            " millimetres (then write metres; commands on objects: pass --unit mm or cm)."
        )


def is_finite(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points are neither NaN nor infinite nor beyond float32."""
    largest, finite = np.finfo(np.float32).max, np.ones(len(points), bool)
    for axis in points.T:  # one at a time: less memory
        finite &= np.abs(axis) <= largest
    return finite


def only_finite(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Those points; the same array where all are."""
    finite = is_finite(points)
    return points if finite.all() else points[finite]
