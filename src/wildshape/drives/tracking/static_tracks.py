# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that are one object which stands: what they saw of it lies in one place.

What passes in front of a parked car cuts its track up. All points of a track together are as large
as the object where it stood, and longer where it moved. Two such tracks whose rectangles share most
of the ground, and that are no larger together, are of one object, whatever gap was between.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import StandConfig
from wildshape.drives.tracking.clusters import level_axes
from wildshape.drives.tracking.sightings import Sightings, merged
from wildshape.geometry.footprint import footprint_overlap
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points


@dataclass(frozen=True)
class _Stood:
    """Where a track's points lie.

    Attributes:
        points: some of all its frames, level world.
        place: centre x, y, z and yaw of the rectangle around most of them.
        size: of it, length and width.
    """

    points: Points
    place: Float[np.ndarray, "4"]
    size: tuple[float, float]

    @classmethod
    def of(cls, points: Points, config: StandConfig) -> "_Stood":
        axes = level_axes(points)
        along = points[:, :2].astype(np.float64) @ axes
        low, high = np.quantile(along, (config.strays, 1 - config.strays), axis=0)
        if (high - low)[0] < (high - low)[1]:
            axes, low, high = axes[:, ::-1], low[::-1], high[::-1]
        x, y = axes @ (low + high) / 2
        place = np.array((x, y, points[:, 2].mean(), np.arctan2(axes[1, 0], axes[0, 0])))
        length, width = (high - low).tolist()
        return cls(points, place, (length, width))

    def fits(self, config: StandConfig) -> bool:
        """Whether it is no larger than a car."""
        return self.size[0] <= config.longest_m and self.size[1] <= config.widest_m

    def share(self, other: "_Stood") -> float:
        """Share of the smaller rectangle."""
        return footprint_overlap(self.place, self.size, other.place, other.size)


def joined_where_they_stand(
    tracks: Sequence[Sightings],
    cuts: Path,
    T_level_sensor: SE3,
    config: StandConfig,
    breaks: Sequence[int] = (),
) -> list[Sightings]:
    """The tracks, those of one standing object put together under the name of the first.

    Args:
        tracks: of a drive.
        cuts: folder of the clusters.
        T_level_sensor: of every frame.
        config: see there.
        breaks: frames whose place could not be told from the one before: nothing is joined across.
    """
    every = (_Stood.of(_some(one, cuts, T_level_sensor, config), config) for one in tracks)
    stood = {i: one for i, one in enumerate(every) if one.fits(config)}
    part = np.searchsorted(breaks, [one.frames[0] for one in tracks], side="right")
    group: dict[int, tuple[int, ...]] = {i: (i,) for i in range(len(tracks))}
    for i, j in _that_share(stood, config):
        both = tuple(sorted({*group[i], *group[j]}))
        if both == group[i] or part[i] != part[j] or _together(tracks, both) > config.together:
            continue
        if _Stood.of(np.concatenate([stood[k].points for k in both]), config).fits(config):
            group.update(dict.fromkeys(both, both))
    return [_as_one([tracks[k] for k in both]) for i, both in group.items() if both[0] == i]


def _that_share(stood: dict[int, _Stood], config: StandConfig) -> list[tuple[int, int]]:
    """Pairs that share enough of the ground, those that share most first."""
    from scipy.spatial import KDTree

    numbers = list(stood)
    places = np.array([one.place[:2] for one in stood.values()]).reshape(-1, 2)
    near = KDTree(places).query_pairs(np.hypot(config.longest_m, config.widest_m))
    pairs = sorted((numbers[a], numbers[b]) for a, b in near)
    shared = {(i, j): stood[i].share(stood[j]) for i, j in pairs}
    enough = [pair for pair in pairs if shared[pair] > config.overlap]
    return sorted(enough, key=lambda pair: -shared[pair])


def _together(tracks: Sequence[Sightings], some: Sequence[int]) -> int:
    """Frames in which more than one of some tracks was seen."""
    frames = [frame for i in some for frame in tracks[i].frames]
    return len(frames) - len(set(frames))


def _as_one(parts: list[Sightings]) -> Sightings:
    """A track of several, under the name of the first."""
    return replace(merged(parts), name=parts[0].name, parts=()) if len(parts) > 1 else parts[0]


def _some(seen: Sightings, cuts: Path, T_level_sensor: SE3, config: StandConfig) -> Points:
    """Some points of some frames, the first and the last among them, level world."""
    spread = np.linspace(0, len(seen.frames) - 1, min(len(seen.frames), config.frames))
    some = seen.part(spread.round().astype(int).tolist())
    return np.concatenate(
        [
            T_level_sensor[frame].apply_numpy(cloud[:: 1 + len(cloud) // config.points])
            for frame, cloud in zip(some.frames, some.clouds(cuts))
        ]
    )
