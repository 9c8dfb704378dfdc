# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which objects and scans of a data set become tracks; what is left out is counted by reason."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from wildshape.records import Points, Track

Motion = Literal["any", "moving", "parked"]
_MOVED_M = 1.0


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
        motion: keep all objects, those that moved over the track, or those that stood.
    """

    every: int = 1
    min_points: int = 100
    min_mean_points: int = 0
    min_scans: int = 1
    range_m: tuple[float, float] = (0.0, float("inf"))
    categories: tuple[str, ...] = ()
    motion: Motion = "any"

    def objection_to_scan(self, points: Points) -> str:
        """Why the points on an object are no scan to keep; empty if they are."""
        if len(points) < self.min_points:
            return f"scan: fewer than {self.min_points} points on the object"
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
        moves = has_moved(places)
        return "" if moves == (self.motion == "moving") else f"object: not {self.motion}"


def has_moved(places: Float[np.ndarray, "V 3"]) -> bool:
    """Whether places `(V, 3)`, metres, spread over more than a metre."""
    return bool(np.linalg.norm(np.ptp(places, axis=0)) > _MOVED_M)
