# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From a user's scan to the network's input (METHOD 2), without chance."""

from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import face, roll
from wildshape.io.scans.points import LEAST_POINTS, check_near, drop_nonfinite, read_scan
from wildshape.records import Points, SensorKind

_USUAL_M = 5.0
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


def resample(points: Points, count: int) -> Points:
    """Exactly `count` points, the same whatever the order of the input.

    Too many: a seeded choice without replacement; too few: all of them, over and over.
    """
    ordered = in_order(points)
    return ordered[drawn(len(ordered), count)]


def in_order(points: Points) -> Points:
    """The same points by z, y, x: sums over them then do not depend on the file's order.

    z and y are sorted as one whole number; x is looked at only where both are equal somewhere.
    """
    bits = (points[:, 1:] + np.float32(0)).view(np.int32)  # no -0
    y, z = (bits ^ ((bits >> 31) & 0x7FFFFFFF)).T.astype(np.int64)  # ordered as the floats are
    key = (z << 32) + y
    order = np.argsort(key)
    ordered = key[order]
    tied = bool((ordered[1:] == ordered[:-1]).any())
    return points[np.lexsort(points.T)] if tied else points[order]


def drawn(size: int, count: int) -> Int64[np.ndarray, "count"]:
    """Which of `size` ordered points a network sees: some of them, or all over and over."""
    if size > count:
        return np.random.default_rng(0).choice(size, count, replace=False)
    return np.arange(count) % size


class NetworkInput(NamedTuple):
    """What a network sees of scans.

    Attributes:
        scans: turned, centred and resampled.
        centres: in the turned sensor frames.
        turn: `R_turned_sensor`; the identity unless scans are turned towards their object.
    """

    scans: Float[Tensor, "B N 3"]
    centres: Float[Tensor, "B 3"]
    turn: Float[Tensor, "B 3 3"]

    def to(self, device: torch.device) -> "NetworkInput":
        """The same on a device."""
        return NetworkInput(*(part.to(device) for part in self))

    def part(self, rows: Int64[Tensor, "b"]) -> "NetworkInput":
        """Some of the scans."""
        return NetworkInput(*(part[rows] for part in self))

    def rolled(self, angle: Float[Tensor, "B"]) -> "NetworkInput":
        """Rolled about the line of sight, on which the centres lie."""
        by = roll(angle)
        return NetworkInput(self.scans @ by.mT, self.centres, by @ self.turn)


def network_input(
    scans: list[Points], count: int, sensor: SensorKind, facing: bool = False
) -> NetworkInput:
    """Scans as a network is given them; `facing` turns them towards their object."""
    ordered = [torch.from_numpy(in_order(scan)) for scan in scans]
    sampled = torch.stack([scan[torch.from_numpy(drawn(len(scan), count))] for scan in ordered])
    if facing:
        frames = [face(scan, sensor_kind=sensor) for scan in ordered]
        turn = torch.stack([frame.turn for frame in frames])
        centres = torch.stack([frame.centre for frame in frames])
        return NetworkInput(sampled @ turn.mT - centres[:, None], centres, turn)
    centres = torch.stack([scan_centre(scan, sensor) for scan in ordered])
    turn = torch.eye(3).repeat(len(scans), 1, 1)
    return NetworkInput(sampled - centres[:, None], centres, turn)


def unit_of(largest_m: float) -> float:
    """Metres of one unit in which objects of up to that extent are as large as vehicles, at most 1.

    Lengths that a method takes for granted (noise, gaps, how far off a pose may be) are stated for
    vehicles; those of smaller objects are as much smaller.
    """
    return min(1.0, largest_m / _USUAL_M)


def extent(points: Points) -> float:
    """Diagonal of the axis-aligned bounding box, metres."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))
