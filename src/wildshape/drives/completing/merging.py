# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that are one vehicle: their complete shapes share a place, whatever gap was between.

A vehicle that stands stays where it is while something hides it; one that moves is expected where
its way leads.
"""

from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np

from wildshape.drives.completing.boxes import Way, expected
from wildshape.drives.completing.placing import Completed
from wildshape.drives.completing.turns import Turns
from wildshape.drives.object_config import BoxConfig, MergeConfig
from wildshape.drives.tracking.sightings import Sightings, merged
from wildshape.geometry.footprint import footprint_overlap

_LOOKED_AT = 7  # frames that tell whether two share a place


@dataclass
class Places:
    """Where completed objects of a drive are, and which of them are one.

    Attributes:
        turns: of the drive's sensor.
        config: see there.
        boxes: how objects move.
    """

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
        pairs = list(combinations(range(len(objects)), 2))
        shared = {(i, j): self.overlap(objects[i], objects[j]) for i, j in pairs}
        group = {i: [i] for i in range(len(objects))}
        for i, j in sorted(pairs, key=lambda pair: -shared[pair]):
            if shared[i, j] <= self.config.overlap:
                break
            one, other = group[i], group[j]
            if one is other:
                continue
            across = [shared[min(pair), max(pair)] for pair in product(one, other)]
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
        common = np.intersect1d(way.frames, beside.frames)
        if not len(common):
            return -1.0
        apart = _apart(common, one.frames) + _apart(common, other.frames)
        found = []
        for frame in common[np.argsort(apart, kind="stable")[:_LOOKED_AT]]:
            here = way.boxes[np.searchsorted(way.frames, frame)]
            there = beside.boxes[np.searchsorted(beside.frames, frame)]
            near = np.hypot(*(here[:2] - there[:2])) < (one.size[0] + other.size[0]) / 2
            found.append(near and footprint_overlap(here, one.size, there, other.size))
        return float(np.median(found))

    def _way(self, one: Completed) -> Way:
        name = one.seen.name
        if name not in self._ways:
            self._ways[name] = expected(one, self.turns, self.config.beyond_ticks, self.boxes)
        return self._ways[name]


def _apart(frames: np.ndarray, completed: tuple[int, ...]) -> np.ndarray:
    """Frames between each of `frames` and the nearest completed one."""
    return np.abs(frames[:, None] - np.array(completed)).min(1)
