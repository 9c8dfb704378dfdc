# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A frame for an object that stood still and has no labelled box (METHOD 8)."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.box import fit_box
from wildshape.geometry.sampling import radius_inliers, voxel_thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

_VOXEL_M, _RADIUS_M, _NEIGHBOURS = 0.05, 0.25, 5
_FEWEST = 32  # a cloud of which fewer would be left stays as it is: it is thin all over


@dataclass(frozen=True)
class StationaryFrame:
    """Where a stationary object's own frame lies.

    Attributes:
        T_sensor_object: one pose a scan; origin at the CENTRE of the box around the accumulated
            scans, x along its longer side, z up as the sensor's was at the middle scan. Which end
            is the front is not known: x is the end that looks forward in the middle scan.
        size: of that box along its own x, y, z, metres.
        spread: diagonal of the smallest upright box around the middles of the scans, metres.
    """

    T_sensor_object: SE3
    size: tuple[float, float, float]
    spread: float


def stand(scans: tuple[Points, ...], T_sensor_world: SE3) -> StationaryFrame:
    """Fit the object's frame to its accumulated scans, without their lonely points.

    Args:
        scans: sensor frames, metres; at least one, none empty.
        T_sensor_world: one a scan; any frame in which the object stands still.
    """
    # The sensor's own vertical at the middle scan stands for the road's: the world's may be tilted.
    T_middle_world = T_sensor_world[len(scans) // 2]
    T_middle_sensor = T_middle_world @ T_sensor_world.inverse()
    moved = [T_middle_sensor[i].apply_numpy(scan) for i, scan in enumerate(scans)]
    box = fit_box(torch.from_numpy(without_lonely(np.concatenate(moved)).astype(np.float64)))
    T_middle_object = SE3(box.rotation, box.centre)
    return StationaryFrame(
        T_sensor_object=T_sensor_world @ T_middle_world.inverse() @ T_middle_object,
        size=(float(box.size[0]), float(box.size[1]), float(box.size[2])),
        spread=_spread(moved),
    )


def without_lonely(points: Points) -> Points:
    """Accumulated scans thinned, and without points that have too few others around them."""
    thinned = voxel_thin(points, _VOXEL_M)
    kept = thinned[radius_inliers(thinned, _RADIUS_M, _NEIGHBOURS)]
    return kept if len(kept) >= _FEWEST else thinned


def _spread(moved: list[Points]) -> float:
    middles: Float[np.ndarray, "V 3"] = np.stack([np.median(points, axis=0) for points in moved])
    return float(np.linalg.norm(np.ptp(middles, axis=0)))
