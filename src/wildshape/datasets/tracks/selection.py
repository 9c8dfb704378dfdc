# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which objects and scans of a data set become tracks; what is left out is counted by reason."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from wildshape.arguments import check_fields, expect_whole
from wildshape.io.scans.points import LARGEST_EXTENT_M
from wildshape.records import Points, Track

Motion = Literal["any", "moving", "parked"]
_FARTHEST_RETURN_M = 1000.0
_FARTHEST_M = 10_000.0
_SECTORS, _FULL = 36, 0.9
LARGEST_M = 20.1
"""What the shipped weights for vehicles take for one: 1.5 times the largest that they learned."""


@dataclass(frozen=True)
class Selection:
    """The filters that all readers share.

    Attributes:
        every: take every k-th frame in which an object is seen.
        min_points: a scan with fewer points on the object is left out (METHOD 2).
        min_mean_points: an object whose scans have fewer on average is left out.
        min_scans: an object with fewer scans is left out.
        range_m: least and largest distance of a scan's middle from the sensor, metres.
        categories: the data set's own words; empty: the reader's usual ones.
        largest_m: a scan with a longer diagonal is left out, metres: it is of more than an object.
        motion: keep all objects, those that moved over the track, or those that stood.
        moved_m: places that spread over more than this are of an object that moved, metres: labels
            of one that stands differ by some decimetres.
    """

    every: int = 1
    min_points: int = 100
    min_mean_points: int = 0
    min_scans: int = 1
    range_m: tuple[float, float] = (0.0, float("inf"))
    largest_m: float = float("inf")
    categories: tuple[str, ...] = ()
    motion: Motion = "any"
    moved_m: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self)
        expect_whole(self.every, "Selection.every", least=1)

    def objection_to_scan(self, points: Points) -> str:
        """Why the points on an object are no scan to keep; empty if they are."""
        least = max(self.min_points, 1)  # nothing is no scan, whoever asks for it
        if len(points) < least:
            return f"scan: fewer than {least} points on the object"
        if not (np.abs(points) < _FARTHEST_M).all():  # NaN is none either
            return "scan: its points are none or farther than any sensor sees"
        sides = np.ptp(points, axis=0)
        if np.linalg.norm(sides) > self.largest_m:
            return _too_large(points, self.largest_m)
        if sides.max() > LARGEST_EXTENT_M:
            return f"scan: over {LARGEST_EXTENT_M:g} m across: check the unit"
        low, high = self.range_m
        if (low, high) == (0.0, float("inf")):
            return ""
        distance = float(np.linalg.norm(np.median(points, axis=0)))
        return "" if low <= distance <= high else f"scan: not within {low:g} to {high:g} m"

    def objection_to_track(self, track: Track, places: Float[np.ndarray, "V 3"] | None) -> str:
        """Why the scans that were kept make no track to keep; empty if they do.

        Args:
            track: of the scans that were kept.
            places: where the object stood in a frame that does not move, metres; None if unknown.
        """
        if len(track.scans) < max(self.min_scans, 1):
            return f"object: fewer than {self.min_scans} scans left"
        if sum(map(len, track.scans)) < self.min_mean_points * len(track.scans):
            return f"object: fewer than {self.min_mean_points} points on average"
        if self.motion == "any":
            return ""
        if places is None:
            return "object: not known whether it moves"
        moves = bool(np.linalg.norm(np.ptp(places, axis=0)) > self.moved_m)
        return "" if moves == (self.motion == "moving") else f"object: not {self.motion}"


def surrounds(points: Points) -> bool:
    """Whether points lie all around the sensor: it saw a scene, not an object."""
    turns = np.arctan2(points[:, 1], points[:, 0])
    seen = np.histogram(turns, _SECTORS, (-np.pi, np.pi))[0] > 0
    return int(seen.sum()) > _FULL * _SECTORS


def _too_large(points: Points, largest_m: float) -> str:
    cure = "cut the objects out first (docs/datasets/folder.md)"
    if surrounds(points):
        return f"scan: a full scan with points all around the sensor, no object: {cure}"
    return f"scan: over {largest_m:g} m across, no single object: {cure}, or raise --largest-m"


def measured(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Which rows are returns of a sensor at the origin: finite, and no farther than 1 km."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(points) <= _FARTHEST_RETURN_M).all(axis=1))
