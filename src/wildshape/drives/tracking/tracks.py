# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which clusters of successive scans are one object: assignment in the world frame.

Each object is expected where it went (a constant velocity, drawn to what was seen). Of all ways to
give clusters to objects the one of least total distance is taken (Kuhn 1955).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import LinkConfig
from wildshape.drives.source import HALF_TICK
from wildshape.drives.tracking.segmentation import read_cuts
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

_FORBIDDEN = 1e6


@dataclass(frozen=True)
class Seen:
    """The clusters of one scan, as far as linking needs them.

    Attributes:
        tick: when.
        centres: `(k, 3)` world frame, metres.
        sizes: `(k, 3)` along the world's axes, metres.
    """

    tick: int | float
    centres: Float[np.ndarray, "k 3"]
    sizes: Float[np.ndarray, "k 3"]

    @classmethod
    def of(cls, tick: int | float, clusters: Sequence[Points]) -> "Seen":
        """What is seen of clusters, world frame: the middle and the size of each one's extent."""
        if not clusters:
            return cls(tick, np.empty((0, 3)), np.empty((0, 3)))
        starts = np.cumsum([0, *map(len, clusters[:-1])])
        points = np.concatenate(clusters).astype(np.float64)
        low, high = (end.reduceat(points, starts) for end in (np.minimum, np.maximum))
        return cls(tick, (low + high) / 2, high - low)


@dataclass
class Linked:
    """One object: its cluster's row in each frame in which it was seen."""

    centre: Float[np.ndarray, "3"]
    size: Float[np.ndarray, "3"]
    tick: int | float
    velocity: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    frames: list[int] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)


def linked_clusters(
    cuts: Path,
    T_level_sensor: SE3,
    ticks: Sequence[int | float],
    config: LinkConfig,
    wider: float = 1.0,
) -> list[Sightings]:
    """The objects of a drive that were seen in enough scans.

    Args:
        cuts: folder of the clusters.
        T_level_sensor: of every frame.
        ticks: when each frame was taken.
        config: see there.
        wider: `LinkConfig.wider` of the drive.
    """
    counts = []
    usable = 0

    def seen() -> Iterator[Seen]:
        nonlocal usable
        for frame, cut in enumerate(read_cuts(cuts, len(ticks))):
            counts.append(cut.counts)
            usable += cut.scanned > 0
            yield Seen.of(ticks[frame], cut.moved(T_level_sensor[frame]))

    found = link(seen(), config, wider)
    fewest = min(config.fewest_scans, usable)
    return [
        Sightings.of(f"{number:04d}", one.frames, one.rows, counts)
        for number, one in enumerate(one for one in found if len(one.frames) >= fewest)
    ]


def link(scans: Iterable[Seen], config: LinkConfig, wider: float = 1.0) -> list[Linked]:
    """The objects seen in scans in time order, in the order in which they were first seen."""
    every: list[Linked] = []
    live: list[Linked] = []
    for frame, seen in enumerate(scans):
        live = [one for one in live if seen.tick - one.tick < config.longest_gap + HALF_TICK]
        pairs = _assigned(live, seen, config, wider)
        for row in range(len(seen.centres)):
            if row in pairs:
                _go_on(live[pairs[row]], seen, row, config)
            else:
                one = Linked(seen.centres[row], seen.sizes[row], seen.tick)
                every.append(one)
                live.append(one)
                pairs[row] = len(live) - 1
            live[pairs[row]].frames.append(frame)
            live[pairs[row]].rows.append(row)
    return every


def _assigned(live: list[Linked], seen: Seen, config: LinkConfig, wider: float) -> dict[int, int]:
    """For each cluster that goes on with a live object, the object's place in `live`."""
    if not live or not len(seen.centres):
        return {}
    gaps = np.array([seen.tick - one.tick for one in live])
    expected = np.stack([one.centre + one.velocity * gap for one, gap in zip(live, gaps)])
    sizes = np.stack([one.size for one in live])
    apart = np.linalg.norm(
        _shift(expected[:, None], sizes[:, None], seen.centres, seen.sizes)[..., :2], axis=-1
    )
    unlike = np.abs(sizes[:, None] - seen.sizes).max(-1)
    once = np.array([len(one.frames) == 1 for one in live])  # its speed is not known yet
    gate = np.where(once, config.first_gate_m, config.gate_m) + config.gate_per_tick_m * (gaps - 1)
    cost = apart + config.size_weight * unlike
    cost = np.where(cost < wider * gate[:, None], cost, _FORBIDDEN)
    found = _cheapest(np.where(cost < gate[:, None], cost, _FORBIDDEN))
    if wider > 1:
        cost[unlike > config.like_m] = _FORBIDDEN
        cost[list(found.values())] = _FORBIDDEN
        cost[:, list(found)] = _FORBIDDEN
        found |= _cheapest(cost)
    return found


def _cheapest(cost: Float[np.ndarray, "o k"]) -> dict[int, int]:
    """For each column that is given to a row at the least total cost, that row."""
    from scipy.optimize import linear_sum_assignment

    chosen = zip(*linear_sum_assignment(cost))
    return {int(column): int(row) for row, column in chosen if cost[row, column] < _FORBIDDEN}


def _shift(
    expected: Float[np.ndarray, "*o 3"],
    size: Float[np.ndarray, "*o 3"],
    centre: Float[np.ndarray, "*c 3"],
    seen_size: Float[np.ndarray, "*c 3"],
) -> Float[np.ndarray, "*b 3"]:
    """How far something is from where it was expected, the least of its middle and its two ends.

    Where more or less of it is seen than before, one end stays.
    """
    middle, wider = centre - expected, (seen_size - size) / 2
    shifts = np.stack((middle, middle - wider, middle + wider))
    least = np.abs(shifts).argmin(0)
    return np.take_along_axis(shifts, least[None], axis=0)[0]


def _go_on(one: Linked, seen: Seen, row: int, config: LinkConfig) -> None:
    """An object seen again."""
    gap = seen.tick - one.tick
    expected = one.centre + one.velocity * gap
    shift = _shift(expected, one.size, seen.centres[row], seen.sizes[row])
    gain = config.velocity_gain if len(one.frames) > 1 else 0.5
    one.velocity = one.velocity + gain * shift / max(gap, HALF_TICK)
    one.centre, one.size, one.tick = seen.centres[row], seen.sizes[row], seen.tick
