# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands on the ground of one scan and hangs together: where vehicles may be.

Points nearer to each other than a reach hang together. The reach grows with range as beams spread:
`e = a + b r`. Coordinates in which it is 1 are `ln(e / a) / b` along r (the integral of `dr / e`),
`azimuth r / e` and `z / e`. That holds near an azimuth of 0 alone, so azimuths are counted from the
middle of a sector; sectors overlap, and parts that have a point in common are one.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.config import ClusterConfig
from wildshape.ops.connected import connected_parts
from wildshape.ops.spans import spans
from wildshape.records import Points

_SIZED_BY = 1000  # points of a cluster that tell its size
_SECTORS, _OVERLAP = 6, np.deg2rad(12.0)  # at 2 m the reach is 9 degrees wide
_SECTOR = 2 * np.pi / _SECTORS
_FAR = 1000.0  # reaches
_TURNS = np.deg2rad(np.arange(0.0, 90.0, 2.0))
_AHEAD = np.stack((np.cos(_TURNS), np.sin(_TURNS)))
_ASIDE = np.stack((-np.sin(_TURNS), np.cos(_TURNS)))
_AROUND = np.concatenate((_AHEAD, _ASIDE), axis=1)

Rows = Int[np.ndarray, "k"]


@dataclass(frozen=True)
class _Above:
    """The points of a scan that stand above its ground.

    Attributes:
        points: level frame.
        heights: above the ground.
        scaled: where a step of 1 is the reach: each point in its sector, then those that the next
            sector has, too, in that one.
        twin: the row in `scaled` of a point's second place; -1 where it has one alone.
    """

    points: Points
    heights: Float[np.ndarray, "n"]
    scaled: Float[np.ndarray, "m 3"]
    twin: Int[np.ndarray, "n"]

    @classmethod
    def of(cls, points: Points, heights: Float[np.ndarray, "n"], config: ClusterConfig) -> "_Above":
        """With the places of its points in their sectors."""
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        sector = np.rint(azimuth / _SECTOR)
        off = azimuth - sector * _SECTOR
        shared = np.flatnonzero(np.abs(off) > _SECTOR / 2 - _OVERLAP)
        beside = np.sign(off[shared])
        off = np.concatenate((off, off[shared] - beside * _SECTOR))
        number = np.concatenate((sector, sector[shared] + beside)) % _SECTORS
        scaled = _scaled(np.concatenate((points, points.take(shared, axis=0))), off, config)
        scaled[:, 0] += number * _FAR  # sectors are joined by rows alone
        twin = np.full(len(points), -1)
        twin[shared] = len(points) + np.arange(len(shared))
        return cls(points, heights, scaled, twin)


def find_clusters(
    points: Points, heights: Float[np.ndarray, "n"], config: ClusterConfig
) -> list[Rows]:
    """The rows of each cluster that may be a vehicle, the nearest to the sensor first.

    Args:
        points: of a whole scan, level frame.
        heights: of each above the ground, metres (`ground.py`).
        config: see there.
    """
    away = np.hypot(points[:, 0], points[:, 1])
    with np.errstate(invalid="ignore"):
        above = (heights > config.lowest_m) & (heights < config.highest_m)
    rows = np.flatnonzero(above & (away < config.range_m))
    if len(rows) < config.fewest_points:
        return []
    scan = _Above.of(points.take(rows, axis=0), heights[rows], config)
    everything = np.arange(len(rows))
    found = [rows[part] for part in _vehicle_sized(scan, everything, (1.0, *config.finer), config)]
    return sorted(found, key=lambda part: float(away[part].min()))


def _hanging_together(
    scan: _Above, rows: Int[np.ndarray, "n"], reach: float, config: ClusterConfig
) -> list[Rows]:
    """Some rows of a scan by parts, the larger first; `reach`: as a multiple of the usual one."""
    twins = scan.twin[rows]
    doubled = np.flatnonzero(twins >= 0)
    points = scan.scaled.take(np.concatenate((rows, twins[doubled])), axis=0)
    pairs = np.stack((doubled, len(rows) + np.arange(len(doubled))), axis=1)
    label = connected_parts(points, reach, config.thin * reach, pairs)[: len(rows)]
    return [rows[part] for part in _parts(label, config.fewest_points)]


def _scaled(
    points: Points, azimuth: Float[np.ndarray, "n"], config: ClusterConfig
) -> Float[np.ndarray, "n 3"]:
    away = np.hypot(points[:, 0], points[:, 1])
    reach = config.reach_m + config.reach_per_m * away
    outwards = np.log(reach / config.reach_m) / config.reach_per_m
    return np.stack((outwards, azimuth * away / reach, config.upright * points[:, 2] / reach), 1)


def _vehicle_sized(
    scan: _Above, rows: Rows, reaches: tuple[float, ...], config: ClusterConfig
) -> Iterator[Rows]:
    """Clusters of the size of vehicles; those too large are cut apart with the finer reaches."""
    for part in _hanging_together(scan, rows, reaches[0], config):
        if not _stands(scan.heights[part], config):
            continue
        members = _without_overhang(scan, part, config)
        if len(members) < config.fewest_points or not _stands(scan.heights[members], config):
            continue
        length, width = extents(scan.points.take(members, axis=0))
        if length <= config.longest_m and width <= config.widest_m:
            if length >= config.shortest_m:
                yield members
        elif len(reaches) > 1:
            yield from _vehicle_sized(scan, members, reaches[1:], config)


def _without_overhang(scan: _Above, rows: Rows, config: ClusterConfig) -> Int[np.ndarray, "some"]:
    """A cluster without what is high and reaches out beyond what is below: a tree over a car."""
    low = scan.heights[rows] < config.overhang_m
    if low.all() or low.sum() < config.fewest_points:
        return rows
    points = scan.points.take(rows, axis=0)
    below = points.compress(low, axis=0)
    axes = level_axes(below)
    begins, ends = spans(below, axes)
    x, y = points[~low, :2].T.astype(np.float64)
    above = axes[0][:, None] * x + axes[1][:, None] * y
    beyond = np.maximum(above - ends[:, None], begins[:, None] - above).max(0)
    return rows[low] if (beyond > config.beyond_m).mean() > config.beyond else rows


def _parts(label: Int[np.ndarray, "n"], fewest: int) -> list[Rows]:
    """The rows of each label that has so many, the more the earlier."""
    counts = np.bincount(label)
    few = label.astype(np.min_scalar_type(len(counts)))  # sorted by digits
    order = np.argsort(few, kind="stable")
    ends = np.cumsum(counts)
    enough = np.flatnonzero(counts >= fewest)
    parts = [order[ends[one] - counts[one] : ends[one]] for one in enough]
    return sorted(parts, key=len, reverse=True)


def _stands(heights: Float[np.ndarray, "k"], config: ClusterConfig) -> bool:
    """Whether something reaches down to the ground and up to where a bonnet is."""
    return bool(heights.min() < config.highest_bottom_m and heights.max() > config.lowest_top_m)


def extents(points: Points) -> tuple[float, float]:
    """Length and width of the upright rectangle of least area, of 2 degrees' steps, metres."""
    begins, ends = spans(points, level_axes(points))
    width, length = np.sort(ends - begins).tolist()
    return length, width


def level_axes(points: Points) -> Float[np.ndarray, "2 2"]:
    """Of the rectangle of least area seen from above, of 2 degrees' steps; columns."""
    begins, ends = spans(points[:: 1 + len(points) // _SIZED_BY], _AROUND)
    ahead, aside = (ends - begins).reshape(2, -1)
    best = (ahead * aside).argmin()
    return np.stack((_AHEAD[:, best], _ASIDE[:, best]), axis=1)
