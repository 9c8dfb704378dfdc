# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which rays of a frame are kept with an object: those in its frustum, widened by 1 m.

A frame is sorted by azimuth once. Each object then looks at its own part alone.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from wildshape.geometry.projection.sight_lines import SightLines

MOST_RAYS = 2048
"""Rays that are kept with a scan at most."""

_MARGIN_M, _NEAREST_M = 1.0, 1.0
_BINS = 1 << 16  # of azimuth: numbers of 16 bits are sorted by their digits
_STEEP, _LEAST_COSINE = 1.4, 0.1  # steeper or wider frusta may reach all around


@dataclass(frozen=True)
class FullScan:
    """All that a frame's sensor says, sensor frame, metres.

    Attributes:
        points: `(s, 3)` its returns.
        origins: where the ray of each began, and then that of each that is lost, where several
            sensors are merged, or one that moved.
        lost: `(k, 3)` unit directions of rays of which the sensor's grid says that nothing came
            back; only of a single sensor.
    """

    points: np.ndarray
    origins: np.ndarray | None = None
    lost: np.ndarray | None = None

    @property
    def nbytes(self) -> int:
        """Memory that it takes, once it was sorted."""
        known = (self.points, self.origins, self.lost)
        return sum(2 * one.nbytes for one in known if one is not None)

    @cached_property
    def ends(self) -> Float[np.ndarray, "n 3"]:
        """The returns, then the directions of what was lost."""
        if self.lost is None:
            return self.points
        return np.concatenate((self.points, self.lost))

    @cached_property
    def _sorted(self) -> "_Sorted":
        return _Sorted.of(self.ends)

    def near(self, rows: Int[np.ndarray, "k"], most: int = MOST_RAYS) -> Int[np.ndarray, "m"]:
        """The rays beside those of one object, as rows of `ends` in rising order.

        They lie in the object's frustum widened by 1 m at its nearest point. Of more than `most`
        every so many-th is taken.

        Args:
            rows: of the object's own returns; at least one.
            most: rows returned at most.
        """
        frustum = _Frustum.around(self.points[rows])
        span = frustum.azimuths()
        some = np.arange(len(self.ends)) if span is None else self._sorted.between(*span)
        beside = np.zeros(len(self.ends), bool)
        beside[some[frustum.rows_within(self.ends.take(some, axis=0))]] = True
        beside[rows] = False
        return thinned(np.flatnonzero(beside), most)


def sight_lines(
    full: FullScan, rows: Int[np.ndarray, "k"], most: int = MOST_RAYS
) -> SightLines | None:
    """The rays of a frame beside those of one object, at most `most`; see `FullScan.near`.

    Args:
        full: the frame.
        rows: of the object's own returns; none for none.
        most: rays returned at most.
    """
    if not len(rows):
        return None
    near = full.near(rows, most)
    ends, lost = full.ends[near], near >= len(full.points)
    origins = None if full.origins is None else full.origins[near]
    if origins is not None:
        ends[lost] += origins[lost]
    rays = SightLines.of_returns(ends, origins)
    rays.ranges[lost] = np.inf
    return rays


def thinned(rows: Int[np.ndarray, "k"], most: int) -> Int[np.ndarray, "m"]:
    """Every so many-th, so that at most `most` are left."""
    return rows if len(rows) <= most else rows[np.arange(most) * len(rows) // most]


class _Sorted(NamedTuple):
    """The rows of a frame by their azimuth about z.

    Attributes:
        order: the rows.
        bins: of azimuth, from -pi to pi, that each of them lies in; rising.
    """

    order: Int[np.ndarray, "n"]
    bins: Int[np.ndarray, "n"]

    @classmethod
    def of(cls, ends: Float[np.ndarray, "n 3"]) -> "_Sorted":
        bins = np.floor(_bins(np.arctan2(ends[:, 1], ends[:, 0]))).astype(np.int64)
        bins = (bins % _BINS).astype(np.uint16)
        order = np.argsort(bins, kind="stable").astype(np.int32)
        return cls(order, bins[order])

    def between(self, low: float, high: float) -> Int[np.ndarray, "k"]:
        """Rows from one azimuth to another, and a few around them; radians, `low` is less."""
        first, last = int(_bins(low)) - 2, int(_bins(high)) + 2
        if last - first >= _BINS:
            return self.order
        start = np.searchsorted(self.bins, np.uint16(first % _BINS), "left")
        end = np.searchsorted(self.bins, np.uint16(last % _BINS), "right")
        if first % _BINS <= last % _BINS:
            return self.order[start:end]
        return np.concatenate((self.order[start:], self.order[:end]))


class _Frustum(NamedTuple):
    """What is seen of an object from the sensor, and 1 m around it.

    Attributes:
        axes: as columns: along the mean direction of its points, to its left and up.
        low: least azimuth and pitch in these axes, radians.
        high: greatest.
    """

    axes: Float[np.ndarray, "3 3"]
    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]

    @classmethod
    def around(cls, points: Float[np.ndarray, "k 3"]) -> "_Frustum":
        points = points.astype(np.float64)
        away = np.linalg.norm(points, axis=1)
        axes = _facing(points / np.maximum(away, 1e-9)[:, None])
        own = _angles(points @ axes)
        nearest = max(float(away.min()), _NEAREST_M)
        return cls(axes, own.min(0) - _MARGIN_M / nearest, own.max(0) + _MARGIN_M / nearest)

    def rows_within(self, ends: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "k"]:
        """Which of the ends of rays lie in it; none at the sensor itself."""
        x, y, z = (ends @ self.axes.astype(ends.dtype)).T
        azimuth = np.arctan2(y, x)
        found = np.flatnonzero((azimuth >= self.low[0]) & (azimuth <= self.high[0]) & (x > 0))
        pitch = np.arctan2(z[found], np.hypot(x[found], y[found]))
        return found[(pitch >= self.low[1]) & (pitch <= self.high[1])]

    def azimuths(self) -> tuple[float, float] | None:
        """Azimuths about the sensor's z that it lies between; None: perhaps all.

        In its axes, pitched by p, a ray of azimuth a and pitch e has the horizontal parts
        `cos e sin a` to the left and `cos e cos a cos p - sin e sin p` ahead. The azimuth grows
        with a and changes one way with e, so corners are its extremes.
        """
        ahead, left = self.axes[:, 0], self.axes[:, 1]
        if left[2] != 0:  # axes of what lies steeply are rolled, too
            return None
        level = float(np.hypot(ahead[0], ahead[1]))
        pitch = np.array((self.low[1], self.high[1]))
        lean = np.tan(pitch) * ahead[2]
        azimuth = np.array((self.low[0], self.high[0]))[:, None]
        forward = np.cos(azimuth) * level - lean
        if np.abs(pitch).max() > _STEEP or min(forward.min(), level - np.abs(lean).max()) < (
            _LEAST_COSINE
        ):
            return None
        corners = np.arctan2(np.sin(azimuth), forward)
        middle = float(np.arctan2(ahead[1], ahead[0]))
        return middle + float(corners.min()), middle + float(corners.max())


def _bins(azimuth: Float[np.ndarray, "*any"] | float) -> Float[np.ndarray, "*any"]:
    """Azimuths as multiples of a bin, from 0 at -pi."""
    return np.asarray((azimuth + np.pi) * (_BINS / (2 * np.pi)))


def _facing(directions: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "3 3"]:
    """Axes as columns: along the mean of directions, to its left and up."""
    mean = directions.mean(0)
    forward = mean / max(float(np.linalg.norm(mean)), 1e-9)
    x, y, z = forward.tolist()
    left = np.array((-y, x, 0.0) if abs(z) < 0.9 else (0.0, -z, y))  # across z, else across x
    left /= np.linalg.norm(left)
    return np.stack((forward, left, np.cross(forward, left)), axis=1)


def _angles(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
    """Azimuth and pitch, radians, in axes x forward, y left, z up."""
    x, y, z = points.T
    return np.stack((np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))), axis=1)
