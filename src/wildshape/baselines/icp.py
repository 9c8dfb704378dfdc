# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Point-to-point ICP of one pair of clouds, the last step of most baselines."""

from dataclasses import dataclass

import numpy as np

from wildshape.baselines.pairs import Cloud
from wildshape.geometry.transforms.se3 import SE3


@dataclass(frozen=True)
class Fit:
    """Where ICP ended.

    Attributes:
        T: `T_target_source`.
        cost: mean over the source points of their squared distance to the target, cut at the
            squared distance threshold: inlier RMSE and fitness in one figure, square metres.
    """

    T: SE3
    cost: float


def point_to_point(
    source: Cloud, target: Cloud, distance: float, iterations: int, start: SE3 | None = None
) -> Fit:
    """ICP by small_gicp on all points, without its downsampling (0.25 m is too coarse for a car).

    Args:
        source: near the origin, metres.
        target: likewise.
        distance: correspondences further apart are ignored, metres.
        iterations: at most.
        start: `T_target_source` to start from; None: no motion.
    """
    import small_gicp

    start = start or SE3.identity()
    result = small_gicp.align(
        small_gicp.PointCloud(target),
        small_gicp.PointCloud(source),
        init_T_target_source=start.matrix.numpy(),
        registration_type="ICP",
        max_correspondence_distance=distance,
        num_threads=1,
        max_iterations=iterations,
        rotation_epsilon=1e-5,
        translation_epsilon=1e-5,
    )
    # Its error is half the sum of squares over the inliers.
    outliers = len(source) - result.num_inliers
    cost = (2 * result.error + outliers * distance**2) / len(source)
    return Fit(SE3.from_matrix(np.array(result.T_target_source)), cost)
