# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Local-ICP of the paper's section 4: point-to-point, consecutive scans, chained (METHOD 9)."""

from collections.abc import Sequence
from dataclasses import dataclass

from wildshape.baselines.icp import point_to_point
from wildshape.baselines.pairs import Cloud, about_centroids, chain, fuse
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor


@dataclass(frozen=True)
class LocalIcp:
    """Point-to-point ICP between consecutive scans, chained to the middle one.

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
        return point_to_point(source, target, self.distance, self.iterations).T
