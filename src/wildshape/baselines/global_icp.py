# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Global-ICP of the paper's section 5.3: features find a start, ICP does the rest (METHOD 9)."""

from dataclasses import dataclass

from wildshape.baselines.fast_global import FastGlobal
from wildshape.baselines.icp import point_to_point
from wildshape.baselines.kiss_matcher import KissMatcher
from wildshape.baselines.pairs import Cloud, from_here
from wildshape.errors import MissingExtraError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor


@dataclass(frozen=True)
class GlobalIcp:
    """Features of a pair of scans matched, then point-to-point ICP.

    Attributes:
        coarse: finds the start of a pair.
        distance: of ICP: correspondences further apart are ignored, metres.
        iterations: of ICP, at most, a pair.
    """

    coarse: FastGlobal | KissMatcher
    # That of Local-ICP; the voxel of `available` is the paper's (experiments/search_baselines.py).
    distance: float = 0.175
    iterations: int = 30

    @property
    def about(self) -> str:
        """The method, its engine and its settings in a line."""
        return (
            f"features by {self.coarse.engine}, then ICP, of neighbours, chained;"
            f" voxel {self.coarse.voxel:g} m, threshold {self.distance:g} m"
        )

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:
        """`T_target_source`."""
        T_target_source = self.coarse.align(source, target, sensor)
        moved = T_target_source.apply_numpy(source)
        return from_here(moved, target, self._solve) @ T_target_source

    def _solve(self, source: Cloud, target: Cloud) -> SE3:
        return point_to_point(source, target, self.distance, self.iterations).T


def available() -> FastGlobal | KissMatcher:
    """Open3D's fast global registration as in the paper, or KISS-Matcher where it is missing.

    Raises:
        MissingExtraError: neither is installed; says how to get one.
    """
    try:
        return FastGlobal(voxel=0.125)
    except MissingExtraError as missing:
        try:
            return KissMatcher(voxel=0.125)
        except MissingExtraError as also:
            raise MissingExtraError(f"global-icp: {missing} Or else: {also}") from also
