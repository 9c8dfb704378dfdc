# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands close around a vehicle that may be none: walls and hedges go on beyond their box."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.completing.cluster_association import in_box
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import SurroundingsConfig
from wildshape.records import Points

_Box = Float[np.ndarray, "4"]


class Surroundings:
    """What whole scans show of vehicles and around them."""

    def __init__(
        self, vehicles: Sequence[Completed], turns: Turns, config: SurroundingsConfig
    ) -> None:
        """`vehicles`: doubtful ones; `turns`: of the drive's sensor."""
        self.vehicles, self.turns, self.config = vehicles, turns, config
        self.frames = frozenset(frame for one in vehicles for frame in one.frames)
        self._counts = {one.seen.name: np.zeros(2) for one in vehicles}

    def counted(self, frame: int, scan: Points) -> dict[str, tuple[int, int]]:
        """Points of a scan, level world, in the boxes of vehicles and around them."""
        found = {}
        for one in self.vehicles:
            if frame in one.frames:
                place = one.frames.index(frame)
                (box,) = self.turns.shown([frame], one.boxes[place : place + 1])
                found[one.seen.name] = _inside_and_around(scan, box, one.size, self.config)
        return found

    def add(self, counted: dict[str, tuple[int, int]]) -> None:
        """Keep what one scan shows."""
        for name, inside_and_around in counted.items():
            self._counts[name] += inside_and_around

    def crowded(self) -> set[str]:
        """Names of those whose completed scans show much close around them."""
        share = self.config.share
        return {name for name, (own, around) in self._counts.items() if around > share * own}


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
