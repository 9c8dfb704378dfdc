# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Generalised ICP (Segal et al., RSS 2009): planes against planes, the strong local baseline."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wildshape.baselines.pairs import Cloud, about_centroids, chain, fuse
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor


@dataclass(frozen=True)
class Gicp:
    """Generalised ICP between consecutive scans from aligned centroids, chained to the middle one.

    Attributes:
        distance: correspondences further apart are ignored, metres.
        neighbours: a point's covariance is that of so many nearest points.
        iterations: at most, a pair.
    """

    # From experiments/search_baselines.py.
    distance: float = 0.3
    neighbours: int = 20
    iterations: int = 30

    @property
    def about(self) -> str:
        """The method and its settings in a line."""
        return (
            f"generalised ICP of neighbours, chained; threshold {self.distance:g} m,"
            f" {self.neighbours} points a covariance"
        )

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_middle_scan`, one a scan."""
        return chain(scans, self.align)

    def complete_track(self, scans: Sequence[Points], sensor: Sensor) -> Points:
        """The fused scans, `(m, 3)` in the middle scan's frame."""
        return fuse(scans, self.register_track(scans, sensor))

    def align(self, source: Points, target: Points) -> SE3:
        """`T_target_source`, started from aligned centroids."""
        return about_centroids(source, target, self._solve)

    def _solve(self, source: Cloud, target: Cloud) -> SE3:
        import small_gicp

        neighbours = min(self.neighbours, len(source), len(target))
        clouds = [small_gicp.PointCloud(points) for points in (target, source)]
        trees = [small_gicp.KdTree(cloud, num_threads=1) for cloud in clouds]
        for cloud, tree in zip(clouds, trees, strict=True):
            small_gicp.estimate_covariances(cloud, tree, neighbours, num_threads=1)
        result = small_gicp.align(
            *clouds,
            trees[0],
            registration_type="GICP",
            max_correspondence_distance=self.distance,
            num_threads=1,
            max_iterations=self.iterations,
            rotation_epsilon=1e-5,
            translation_epsilon=1e-5,
        )
        return SE3.from_matrix(np.array(result.T_target_source))
