# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that are one vehicle: their complete shapes share a place, whatever gap was between.

A vehicle that stands stays where it is while something hides it; one that moves is expected where
its way leads.
"""

from dataclasses import dataclass, field

import numpy as np

from wildshape.drives.boxes import Way, expected
from wildshape.drives.config import BoxConfig, MergeConfig
from wildshape.drives.placing import Completed
from wildshape.drives.sightings import Sightings, merged
from wildshape.geometry.footprint import footprint_overlap

_LOOKED_AT = 7  # frames that tell whether two share a place


@dataclass
class Places:
    """Where completed objects of a drive are, and which of them are one.

    Attributes:
        ticks: when each frame of the drive was taken.
        config: see there.
        boxes: how objects move.
    """

    ticks: tuple[int, ...]
    config: MergeConfig
    boxes: BoxConfig
    _ways: dict[str, Way] = field(default_factory=dict)

    def fragments(self, objects: list[Completed]) -> list[Sightings]:
        """Those of several tracks, or pieces of one scan, that are one by their shapes."""
        from scipy.sparse.csgraph import connected_components

        shared = np.eye(max(len(objects), 1), dtype=bool)
        for i, one in enumerate(objects):
            for j, other in enumerate(objects[:i]):
                shared[i, j] = self.share(one, other)
        count, group = connected_components(shared[: len(objects), : len(objects)], directed=False)
        groups = [[objects[i].seen for i in np.flatnonzero(group == g)] for g in range(count)]
        return [merged(parts) for parts in groups if len(parts) > 1]

    def share(self, one: Completed, other: Completed) -> bool:
        """Whether two objects share a place in most of the frames that tell.

        These are frames in which both are expected, the nearest to those completed.
        """
        way, beside = self._way(one), self._way(other)
        common = np.intersect1d(way.frames, beside.frames)
        if not len(common):
            return False
        apart = _apart(common, one.frames) + _apart(common, other.frames)
        found = []
        for frame in common[np.argsort(apart, kind="stable")[:_LOOKED_AT]]:
            here = way.boxes[np.searchsorted(way.frames, frame)]
            there = beside.boxes[np.searchsorted(beside.frames, frame)]
            near = np.hypot(*(here[:2] - there[:2])) < (one.size[0] + other.size[0]) / 2
            found.append(near and footprint_overlap(here, one.size, there, other.size))
        return float(np.median(found)) > self.config.overlap

    def _way(self, one: Completed) -> Way:
        name = one.seen.name
        if name not in self._ways:
            self._ways[name] = expected(one, self.ticks, self.config.beyond_ticks, self.boxes)
        return self._ways[name]


def _apart(frames: np.ndarray, completed: tuple[int, ...]) -> np.ndarray:
    """Frames between each of `frames` and the nearest completed one."""
    return np.abs(frames[:, None] - np.array(completed)).min(1)
