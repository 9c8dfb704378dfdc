# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Height and tilt of the sensor by the ground that was seen of late.

Laid on it by voxelized GICP (Koide et al., ICRA 2021), small_gicp's, from surface to surface. Of
the way along the ground it says nothing.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import TrajectoryConfig
from wildshape.geometry.transforms.rotation import smallest_turn
from wildshape.records import Points

_NEAR = 10  # points around one that tell its surface
_FEWEST_POINTS, _ROUNDS = 50, 5


class GroundMap:
    """The ground around the last scans, in the world.

    Args:
        config: see there.
        up: the vertical in the sensor frame, unit length.
    """

    def __init__(self, config: TrajectoryConfig, up: Float[np.ndarray, "3"]) -> None:
        import small_gicp

        self.config, self.up = config, up / np.linalg.norm(up)
        self._cells = small_gicp.GaussianVoxelMap(config.ground_cell_m)
        self._seen: Any = None

    def see(self, ground: Points) -> None:
        """Take the ground of the next scan: `(g, 3)` points, sensor frame, metres."""
        import small_gicp

        self._seen = None
        if len(ground) >= _FEWEST_POINTS:
            self._seen = small_gicp.PointCloud(ground.astype(np.float64))
            small_gicp.estimate_covariances(self._seen, small_gicp.KdTree(self._seen), _NEAR)

    def levelled(self, T_world_sensor: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """A pose near by, lifted and tilted so that what is seen lies on the map."""
        import small_gicp

        if self._seen is None or not self._cells.size():
            return T_world_sensor
        found = small_gicp.align(
            self._cells,
            self._seen,
            init_T_target_source=T_world_sensor,
            max_correspondence_distance=self.config.ground_reach_m,
            max_iterations=_ROUNDS,
            rotation_epsilon=self.config.settled,
            translation_epsilon=self.config.settled,
        )
        return _levelled(T_world_sensor, found.T_target_source, self.up)

    def add(self, T_world_sensor: Float[np.ndarray, "4 4"]) -> None:
        """What is seen belongs to the map."""
        if self._seen is not None:
            self._cells.insert(self._seen, T_world_sensor)


def _levelled(
    pose: Float[np.ndarray, "4 4"],
    other: Float[np.ndarray, "4 4"],
    up: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "4 4"]:
    """A pose with the height and the tilt of another one; `up`: in the sensor frame."""
    vertical = other[:3, :3] @ up
    levelled = pose.copy()
    levelled[:3, :3] = smallest_turn(pose[:3, :3] @ up, vertical) @ pose[:3, :3]
    levelled[:3, 3] += vertical * (vertical @ (other[:3, 3] - pose[:3, 3]))
    return levelled
