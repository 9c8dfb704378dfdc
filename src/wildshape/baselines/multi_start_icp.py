# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""ICP from many headings, the best kept: what local ICP lacks where scans are turned in yaw."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import torch

from wildshape.baselines.icp import Fit, point_to_point
from wildshape.baselines.pairs import Cloud, about_centroids, chain, fuse
from wildshape.geometry.outliers import voxel_thin
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, SensorKind


@dataclass(frozen=True)
class MultiStartIcp:
    """Point-to-point ICP between consecutive scans from several headings, chained to the middle.

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

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan."""
        return chain(scans, partial(self.align, kind=sensor.kind))

    def complete_track(self, scans: Sequence[Points], sensor: Sensor) -> Points:
        """The fused scans, `(m, 3)` in the middle scan's frame."""
        return fuse(scans, self.register_track(scans, sensor))

    def align(self, source: Points, target: Points, kind: SensorKind) -> SE3:
        """`T_target_source` of the best fit."""
        return about_centroids(source, target, partial(self._solve, kind=kind))

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
