# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Height and tilt of the sensor by the ground that was seen of late.

Laid on it by voxelized GICP (Koide et al., ICRA 2021), small_gicp's, from surface to surface. Of
the way along the ground it says nothing.
"""

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

    def levelled(
        self, T_world_sensor: Float[np.ndarray, "4 4"], ground: Points
    ) -> Float[np.ndarray, "4 4"]:
        """A pose lifted and tilted so that the scan's ground lies on the map; it is added to it.

        Args:
            T_world_sensor: a pose near by.
            ground: `(g, 3)` points, sensor frame, metres.
        """
        import small_gicp

        if len(ground) < _FEWEST_POINTS:
            return T_world_sensor
        cloud = small_gicp.PointCloud(ground.astype(np.float64))
        small_gicp.estimate_covariances(cloud, small_gicp.KdTree(cloud), _NEAR)
        if self._cells.size():
            found = small_gicp.align(
                self._cells,
                cloud,
                init_T_target_source=T_world_sensor,
                max_correspondence_distance=self.config.ground_reach_m,
                max_iterations=_ROUNDS,
                rotation_epsilon=self.config.settled,
                translation_epsilon=self.config.settled,
            )
            T_world_sensor = _levelled(T_world_sensor, found.T_target_source, self.up)
        self._cells.insert(cloud, T_world_sensor)
        return T_world_sensor


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
