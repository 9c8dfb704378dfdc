# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Truth for real tracks: scans accumulated by the labelled poses (METHOD 8).

For evaluation only. Training never needs it.
"""

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.outliers import statistical_inliers, voxel_thin
from wildshape.records import Points, Track

VOXEL_M = 0.04


def fuse_by_truth(track: Track) -> Points:
    """All scans `(n, 3)` in the object frame, metres, as they are.

    Raises:
        BadInputError: the track has no poses.
    """
    if track.T_sensor_object is None:
        raise BadInputError(f"{track.name}: no poses, so its scans cannot be accumulated as truth.")
    T_object_sensor = track.T_sensor_object.inverse()
    moved = [T_object_sensor[i].apply_numpy(scan) for i, scan in enumerate(track.scans)]
    return np.concatenate(moved) if moved else np.zeros((0, 3), np.float32)


def shape_partial(track: Track, *, floor: float | None = None, voxel: float = VOXEL_M) -> Points:
    """What the sensor saw of the object over the track: `(g, 3)` in the object frame, metres.

    Args:
        track: with poses, x forward along the object's heading.
        floor: object-frame height under which points are ground; None where the reader has
            already removed it.
        voxel: edge of the cubes the cloud is thinned by, metres.

    Raises:
        BadInputError: the track has no poses.
    """
    return voxel_thin(_clean(track, floor), voxel)


def shape_mirrored(track: Track, *, floor: float | None = None, voxel: float = VOXEL_M) -> Points:
    """`shape_partial` with its reflection at the object's own x-z plane (y -> -y) added.

    Raises:
        BadInputError: the track has no poses.
    """
    return voxel_thin(mirrored(_clean(track, floor)), voxel)


def mirrored(points: Points) -> Points:
    """Points of the object frame with their reflections at its x-z plane (y -> -y)."""
    return np.concatenate((points, points * np.asarray((1, -1, 1), points.dtype)))


def _clean(track: Track, floor: float | None) -> Points:
    points = fuse_by_truth(track)
    if floor is not None:
        points = points[points[:, 2] >= floor]
    return points[statistical_inliers(points)]
