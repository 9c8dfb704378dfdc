# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is handed in from Python as a scan."""

from operator import attrgetter
from pathlib import Path

import numpy as np
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.io.scans.points import LEAST_POINTS, check_near, drop_nonfinite, read_scan
from wildshape.records import Points

_OPEN3D_TENSOR = "point.positions"
_PLACES = ("xyz", "vertices", _OPEN3D_TENSOR, "points")


def as_points(scan: object, name: str = "scan") -> Points:
    """A scan handed in from Python as `(n, 3)` float32, rows that are not finite dropped.

    Args:
        scan: an array or tensor, a path of a scan file, or an object that holds points: of laspy
            (`.xyz`), trimesh (`.vertices`), Open3D (`.points`, `.point.positions`), a `Completion`.
        name: for the error.

    Raises:
        BadInputError: not `(n, 3)`, fewer than 16 finite points, all points equal, or farther than
            1 km from the origin.
    """
    if isinstance(scan, str | Path):
        return read_scan(scan).points
    try:
        points = np.asarray(_coordinates(scan))
        points = points if points.dtype.kind == "f" else points.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise BadInputError(f"{name}: no array of numbers ({error}); pass (n, 3).") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInputError(
            f"{name}: expected points of shape (n, 3), found {points.shape};"
            " pass x, y, z columns in metres."
        )
    check_near(points, name)
    points = drop_nonfinite(points).points
    if len(points) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; at least {LEAST_POINTS} are needed."
        )
    if float(np.ptp(points, axis=0).max()) == 0.0:
        raise BadInputError(f"{name}: all {len(points)} points are equal; is the file damaged?")
    return points


def _coordinates(scan: object) -> object:
    """What of an object is its points; the object itself if it is an array of some kind."""
    if isinstance(scan, Tensor):
        return scan.detach().cpu()
    for place in _PLACES:  # laspy's `points` are records, hence the order
        try:
            held = attrgetter(place)(scan)
        except (AttributeError, KeyError):
            continue
        return held.cpu().numpy() if place == _OPEN3D_TENSOR else held
    return scan
