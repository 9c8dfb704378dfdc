# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Clusters that lie in the box of a vehicle belong to it, whatever track they came from.

So pieces of a vehicle are gathered that are too small to be completed, and scans in which it was
seen before or after its track.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.completing.boxes import Way, expected
from wildshape.drives.completing.level_frame import Completed, as_box_sees
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.config import DriveConfig
from wildshape.drives.tracking.segmentation import read_cuts
from wildshape.drives.tracking.sightings import Sightings
from wildshape.records import Points


@dataclass(frozen=True)
class Association:
    """Vehicles with all that is theirs.

    Attributes:
        vehicles: with more frames and clusters, in the order given.
        parts: names of those that are a part of another, and what is said of them.
    """

    vehicles: list[Completed]
    parts: dict[str, str]


def associate(
    vehicles: list[Completed],
    cuts: Path,
    turns: Turns,
    config: DriveConfig,
) -> Association:
    """Give every cluster to the first vehicle in whose box it lies.

    Args:
        vehicles: the surest first.
        cuts: folder of the clusters.
        turns: of the drive's sensor.
        config: see there.
    """
    ways = [_shown(one, turns, config) for one in vehicles]
    own = [
        {(frame, row): i for frame, rows in zip(one.seen.frames, one.seen.rows) for row in rows}
        for i, one in enumerate(vehicles)
    ]
    owner = {key: i for rows in reversed(own) for key, i in rows.items()}
    counts = []
    for frame, cut in enumerate(read_cuts(cuts, len(turns.ticks))):
        counts.append(cut.counts)
        for row, i in _in_boxes(
            cut.moved(turns.T_level_sensor[frame]), vehicles, ways, frame, config
        ):
            owner[frame, row] = min(i, owner.get((frame, row), i))
    return _shared_out(vehicles, own, owner, counts, config)


def _shown(one: Completed, turns: Turns, config: DriveConfig) -> Way:
    """The boxes of one where frames show them."""
    way = expected(one, turns, config.association.beyond_ticks, config.boxes)
    return replace(way, boxes=turns.shown(way.frames, way.boxes))


def _in_boxes(
    clusters: list[Points],
    vehicles: list[Completed],
    ways: list[Way],
    frame: int,
    config: DriveConfig,
) -> Iterator[tuple[int, int]]:
    """Each cluster of a frame that lies in a vehicle's box, and whose: places in the lists."""
    centres = np.array([part.mean(0)[:2] for part in clusters]).reshape(-1, 2)
    for i, (one, way) in enumerate(zip(vehicles, ways)):
        if frame not in way.frames:
            continue
        box = way.boxes[frame - way.frames[0]]
        near = np.hypot(*(centres - box[:2]).T) < one.size[0]
        for row in np.flatnonzero(near).tolist():
            inside = in_box(clusters[row], box, one.size, config.association.around_m)
            if inside.mean() >= config.association.inside:
                yield row, i


def in_box(
    points: Points, box: Float[np.ndarray, "4"], size: tuple[float, float, float], around_m: float
) -> Bool[np.ndarray, "n"]:
    """Which points lie in an upright box (centre x, y, z and yaw) or so near around it."""
    reach = np.array(size) / 2 + around_m
    return np.all(np.abs(as_box_sees(points, box)) <= reach, axis=1)


def _shared_out(
    vehicles: list[Completed],
    own: list[dict[tuple[int, int], int]],
    owner: dict[tuple[int, int], int],
    counts: list[np.ndarray],
    config: DriveConfig,
) -> Association:
    """The vehicles with what they own; those that lost too much are parts of others."""
    parts = {}
    for i, one in enumerate(vehicles):
        lost = [owner[key] for key in own[i] if owner[key] != i]
        if len(lost) >= config.association.lost * len(own[i]):
            winner = max(set(lost), key=lost.count)
            parts[one.seen.name] = f"part_of_{vehicles[winner].seen.name}"
    rows: list[dict[int, list[int]]] = [{} for _ in vehicles]
    for (frame, row), i in sorted(owner.items()):
        rows[i].setdefault(frame, []).append(row)
    found = [
        replace(one, seen=_with(one.seen, rows[i], counts))
        for i, one in enumerate(vehicles)
        if one.seen.name not in parts
    ]
    return Association(found, parts)


def _with(seen: Sightings, rows: dict[int, list[int]], counts: list[np.ndarray]) -> Sightings:
    """An object that is these clusters."""
    frames = tuple(sorted(rows))
    points = tuple(int(counts[frame][rows[frame]].sum()) for frame in frames)
    return replace(seen, frames=frames, rows=tuple(tuple(rows[f]) for f in frames), points=points)
