# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that are one vehicle: their complete shapes share a place, whatever gap was between.

A vehicle that stands stays where it is while something hides it; one that moves is expected where
its way leads.
"""

from dataclasses import dataclass, field
from functools import cache
from itertools import combinations, product

import numpy as np

from wildshape.drives.completing.boxes import Way, expected
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import BoxConfig, MergeConfig
from wildshape.drives.tracking.sightings import Sightings, merged
from wildshape.geometry.footprint import footprint_overlap

_LOOKED_AT = 7  # frames that tell whether two share a place


@dataclass
class Places:
    """Where completed objects of a drive are, and which of them are one."""

    turns: Turns
    config: MergeConfig
    boxes: BoxConfig
    _ways: dict[str, Way] = field(default_factory=dict)

    def fragments(self, objects: list[Completed]) -> list[Sightings]:
        """Those of several tracks, or pieces of one scan, that are one by their shapes.

        Those that share most are put together first. Two groups stay apart if something in one
        was beside something in the other: a chain of fragments would join two vehicles that follow
        each other.
        """

        @cache
        def share(i: int, j: int) -> float:
            return self.overlap(objects[i], objects[j])

        every = ((pair, share(*pair)) for pair in combinations(range(len(objects)), 2))
        shared = {pair: part for pair, part in every if part > self.config.overlap}
        group = {i: [i] for i in range(len(objects))}
        for i, j in sorted(shared, key=lambda pair: -shared[pair]):
            one, other = group[i], group[j]
            if one is other:
                continue
            across = [share(min(pair), max(pair)) for pair in product(one, other)]
            if not any(0 <= part < self.config.apart for part in across):
                one += other
                group.update(dict.fromkeys(other, one))
        groups = {id(of): sorted(of) for of in group.values()}
        return [merged([objects[i].seen for i in of]) for of in groups.values() if len(of) > 1]

    def share(self, one: Completed, other: Completed) -> bool:
        """Whether two objects share a place in most of the frames that tell."""
        return self.overlap(one, other) > self.config.overlap

    def overlap(self, one: Completed, other: Completed) -> float:
        """Share of the smaller footprint in the middle one of the frames that tell.

        These are frames in which both are expected, the nearest to those completed; -1 if there
        are none.
        """
        way, beside = self._way(one), self._way(other)
        first = max(way.frames[0], beside.frames[0])
        common = range(first, min(way.frames[-1], beside.frames[-1]) + 1)
        if not common:
            return -1.0
        reach = (one.size[0] + other.size[0]) / 2
        if _apart(way, beside) >= reach:
            return 0.0
        frames = common[:1]  # of two that stand any one tells
        if way.moving or beside.moving:
            frames = _nearest(np.array(common), one.frames, other.frames)
        found = []
        for frame in frames:
            here, there = (of.boxes[frame - of.frames[0]] for of in (way, beside))
            near = np.hypot(*(here[:2] - there[:2])) < reach
            found.append(near and footprint_overlap(here, one.size, there, other.size))
        return float(np.median(found))

    def _way(self, one: Completed) -> Way:
        name = one.seen.name
        if name not in self._ways:
            self._ways[name] = expected(one, self.turns, self.config.beyond_ticks, self.boxes)
        return self._ways[name]


def _apart(one: Way, other: Way) -> float:
    """How far two ways stay from each other at least, metres; below 0 where they may cross."""
    (low, high), (least, most) = one.bounds, other.bounds
    return float(np.maximum(low - most, least - high).max())


def _nearest(frames: np.ndarray, *completed: tuple[int, ...]) -> np.ndarray:
    """Those of `frames` that are nearest to the completed ones, of each object, together."""
    apart = sum(np.abs(frames[:, None] - np.array(own)).min(1) for own in completed)
    return frames[np.argsort(apart, kind="stable")[:_LOOKED_AT]]
