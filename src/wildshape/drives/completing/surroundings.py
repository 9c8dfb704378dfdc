# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands close around a vehicle that may be none: walls and hedges go on beyond their box."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.completing.cluster_association import in_box
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import SurroundingsConfig
from wildshape.records import Points

_Box = Float[np.ndarray, "4"]

InOrder = Callable[[Callable[[int], Any], Iterable[int]], Iterable[Any]]
"""`map`, or what does the same by several processes (`parallel/processes.py`)."""


def crowded(
    read: Callable[[int], Points],
    doubtful: Sequence[Completed],
    turns: Turns,
    config: SurroundingsConfig,
    in_order: InOrder = map,
) -> set[str]:
    """Names of those whose completed scans show much close around them.

    Args:
        read: the whole scan of a frame, sensor frame, metres; each is read once.
        doubtful: vehicles that are asked.
        turns: of the drive's sensor.
        config: see there.
        in_order: looks at the scans.
    """
    counts = {one.seen.name: np.zeros(2) for one in doubtful}
    frames = sorted({frame for one in doubtful for frame in one.frames})
    for said in in_order(_Counter(read, doubtful, turns, config), frames):
        for name, inside_and_around in said.items():
            counts[name] += inside_and_around
    return {name for name, (own, around) in counts.items() if around > config.share * own}


@dataclass(frozen=True)
class _Counter:
    """Counts points of a scan in the boxes of vehicles and around them, by their names."""

    read: Callable[[int], Points]
    vehicles: Sequence[Completed]
    turns: Turns
    config: SurroundingsConfig

    def __call__(self, frame: int) -> dict[str, tuple[int, int]]:
        scan = self.turns.T_level_sensor[frame].apply_numpy(self.read(frame))
        found = {}
        for one in self.vehicles:
            if frame in one.frames:
                place = one.frames.index(frame)
                (box,) = self.turns.shown([frame], one.boxes[place : place + 1])
                found[one.seen.name] = _inside_and_around(scan, box, one.size, self.config)
        return found


def _inside_and_around(
    scan: Points, box: _Box, size: tuple[float, float, float], config: SurroundingsConfig
) -> tuple[int, int]:
    """Points in a box, and beside its sides and ends: of what is neither ground nor above it."""
    floor, top = box[2] - size[2] / 2, box[2] + size[2] / 2
    points = scan.compress((scan[:, 2] > floor + config.low_m) & (scan[:, 2] < top), axis=0)
    near = points.compress(np.hypot(*(points[:, :2] - box[:2]).T) < size[0] / 2 + size[1], axis=0)

    def within(ahead_m: float, aside_m: float) -> Bool[np.ndarray, "n"]:
        wide = size[0] + 2 * ahead_m, size[1] + 2 * aside_m, size[2]
        return in_box(near, box, wide, 0.0)

    own = within(config.near_m, config.near_m)
    around = within(config.far_m, 0.0) | within(0.0, config.far_m)
    return int(own.sum()), int((around & ~own).sum())
