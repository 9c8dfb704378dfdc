# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""ICP of a pair of scans, by small_gicp: from one start, from many headings, plane to plane."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from wildshape.baselines.pairs import Cloud, about_centroids
from wildshape.geometry.sampling import voxel_thin
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, SensorKind


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


@dataclass(frozen=True)
class LocalIcp:
    """Local-ICP (paper 5.3, METHOD 9): point-to-point ICP between consecutive scans.

    Each pair starts from aligned centroids. The paper does not say where it starts; it uses Open3D,
    whose default is no motion at all. A scan here lies in its own sensor frame, where a parked car
    moves by the ego motion of about a metre a scan, far beyond the distance threshold: from there
    ICP finds nothing (measured on KITTI drive 0001: 25 degrees and 4.9 m instead of 1.7 and 0.05).

    Attributes:
        distance: correspondences further apart are ignored, metres (the paper's 0.175).
        iterations: at most, a pair (30: Open3D's default, which the paper used).
    """

    # The paper's; experiments/search_baselines.py finds nothing that is clearly better.
    distance: float = 0.175
    iterations: int = 30

    @property
    def about(self) -> str:
        """The method and its settings in a line."""
        return f"point-to-point ICP of neighbours, chained; threshold {self.distance:g} m"

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_target_source`, started from aligned centroids."""
        return about_centroids(source, target, self._solve)

    def _solve(self, source: Cloud, target: Cloud) -> SE3:
        return point_to_point(source, target, self.distance, self.iterations).T


@dataclass(frozen=True)
class MultiStartIcp:
    """Point-to-point ICP from several headings: what local ICP lacks where scans are turned in yaw.

    Starts are turns about the centroid and the sensor's vertical (z of a LiDAR, y of a camera), so
    rotations all over SO(3) are beyond it. They run on thinned clouds; the fit with the least
    truncated squared distance wins, which knows nothing of the truth, and ends on all points.

    Attributes:
        starts: headings, evenly around the circle, the first of them no turn at all.
        distance: correspondences further apart are ignored, metres.
        voxel: edge of the cubes that thin the clouds for the starts, metres.
        iterations: at most, a start.
    """

    # From experiments/search_baselines.py.
    starts: int = 12
    distance: float = 0.175
    voxel: float = 0.15
    iterations: int = 30

    @property
    def about(self) -> str:
        """The method and its settings in a line."""
        return (
            f"point-to-point ICP of neighbours from {self.starts} headings, the best fit kept,"
            f" chained; threshold {self.distance:g} m"
        )

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:
        """`T_target_source` of the best fit."""
        return about_centroids(source, target, partial(self._solve, kind=sensor.kind))

    def _solve(self, source: Cloud, target: Cloud, kind: SensorKind) -> SE3:
        thin_source, thin_target = voxel_thin(source, self.voxel), voxel_thin(target, self.voxel)
        fits = [self._fit(thin_source, thin_target, start) for start in headings(self.starts, kind)]
        best = min(fits, key=lambda fit: fit.cost)
        return self._fit(source, target, best.T).T

    def _fit(self, source: Cloud, target: Cloud, start: SE3) -> Fit:
        return point_to_point(source, target, self.distance, self.iterations, start)


def headings(count: int, kind: SensorKind) -> list[SE3]:
    """`count` turns about the sensor's vertical, evenly around the circle, no turn first."""
    about_z = rotation_z(2 * math.pi / count * torch.arange(count, dtype=torch.float64))
    # Axes relabelled (y, z, x): the same turn about y.
    order = torch.tensor([0, 1, 2] if kind == "lidar" else [1, 2, 0])
    turns = about_z[:, order][:, :, order]
    return [SE3(turn, torch.zeros(3, dtype=torch.float64)) for turn in turns]


@dataclass(frozen=True)
class Gicp:
    """Generalised ICP (Segal et al., RSS 2009) from aligned centroids: planes against planes.

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

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:  # noqa: ARG002
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
