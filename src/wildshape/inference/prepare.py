# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From a user's scan to the network's input (METHOD 2), without chance."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.centring import scan_centre
from wildshape.records import Points, SensorKind

MIN_POINTS = 16


def as_points(scan: object, name: str = "scan") -> Points:
    """A scan handed in from Python as `(n, 3)` float32, rows that are not finite dropped.

    Raises:
        BadInputError: not `(n, 3)`, fewer than 16 finite points, or all points equal.
    """
    try:
        held = scan.detach().cpu() if isinstance(scan, Tensor) else scan
        points = np.asarray(held, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise BadInputError(f"{name}: no array of numbers ({error}); pass (n, 3).") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInputError(
            f"{name}: expected points of shape (n, 3), found {points.shape};"
            " pass x, y, z columns in metres."
        )
    points = points[np.isfinite(points).all(1)]
    if len(points) < MIN_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; at least {MIN_POINTS} are needed."
        )
    if float(np.ptp(points, axis=0).max()) == 0.0:
        raise BadInputError(f"{name}: all {len(points)} points are equal; is the file damaged?")
    return points


def resample(points: Points, count: int) -> Points:
    """Exactly `count` points, the same whatever the order of the input.

    Too many: a seeded choice without replacement; too few: all of them, over and over.
    """
    return _choose(_in_order(points), count)


def _in_order(points: Points) -> Points:
    """The same points by z, y, x: sums over them then do not depend on the file's order."""
    return points[np.lexsort(points.T)]


def _choose(ordered: Points, count: int) -> Points:
    if len(ordered) > count:
        return ordered[np.random.default_rng(0).choice(len(ordered), count, replace=False)]
    return ordered[np.arange(count) % len(ordered)]


def network_input(
    scans: list[Points], count: int, sensor: SensorKind
) -> tuple[Float[Tensor, "B N 3"], Float[Tensor, "B 3"]]:
    """Centred, resampled scans, and the centres in their sensor frames."""
    ordered = [_in_order(scan) for scan in scans]
    centres = torch.stack([scan_centre(torch.from_numpy(scan), sensor) for scan in ordered])
    sampled = torch.stack([torch.from_numpy(_choose(scan, count)) for scan in ordered])
    return sampled - centres[:, None], centres


def extent(points: Points) -> float:
    """Diagonal of the axis-aligned bounding box, metres."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))
