# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the odometry sees of a scan: what stands on the ground, and the ground around the sensor."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.config import DriveConfig
from wildshape.drives.tracking.ceiling import at_ceiling
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import Mounting
from wildshape.ops.connected import first_of_cells
from wildshape.records import Turn


@dataclass(frozen=True)
class Landmarks:
    """Points of a scan, one a cell.

    Attributes:
        standing: on the ground; none of a flat ceiling.
        ground: near the sensor.
    """

    standing: Turn
    ground: Turn

    @property
    def whole(self) -> Turn:
        """All of them."""
        parts = self.standing, self.ground
        times = [one.seconds for one in parts if one.seconds is not None]
        points = np.concatenate([one.points for one in parts])
        return Turn(points, np.concatenate(times) if len(times) == len(parts) else None)


def landmarks(
    turn: Turn, heights: Float[np.ndarray, "n"], mounting: Mounting, config: DriveConfig
) -> Landmarks:
    """Those of a scan; `heights`: of its points above the ground, metres."""
    level, way = mounting.level(turn.points), config.trajectory
    away = np.hypot(level[:, 0], level[:, 1])
    standing = (heights > way.standing_m) & ~at_ceiling(level, away, way)
    ground = (np.abs(heights) < way.standing_m) & (away > way.nearest_m) & (away < way.ground_m)
    return Landmarks(_some(turn, standing, way.voxel_m / 2), _some(turn, ground, way.ground_cell_m))


def landmarks_of(turn: Turn, mounting: Mounting, config: DriveConfig) -> Landmarks:
    """The same, where the heights are not known yet."""
    heights = height_above_ground(mounting.level(turn.points), mounting.height_m, config.ground)
    return landmarks(turn, heights, mounting, config)


def _some(turn: Turn, used: Bool[np.ndarray, "n"], cell_m: float) -> Turn:
    """A point a cell."""
    kept = np.flatnonzero(used)
    some = turn.points.take(kept, axis=0)
    first = first_of_cells(some, cell_m)
    seconds = None if turn.seconds is None else turn.seconds[kept[first]]
    return Turn(some.take(first, axis=0), seconds)
