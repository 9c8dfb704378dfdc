# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Shapes for tracks that have poses alone: the truth builder's options (METHOD 8)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from wildshape.datasets.tracks.accumulation import VOXEL_M, fuse_by_truth, mirrored
from wildshape.geometry.outliers import radius_inliers, statistical_inliers, voxel_thin
from wildshape.records import Points, Track

_LOWEST = 0.005


@dataclass(frozen=True)
class TruthBuilder:
    """Makes a track's `shape` from its scans and poses.

    Attributes:
        kind: `partial` is what the sensor saw of the object over the track; `mirrored` adds the
            reflection at the object's own x-z plane (y -> -y).
        outliers: which rule removes stray points; see `geometry.outliers`.
        radius: of the rule `radius`: a point needs `neighbours` others within this, metres.
        neighbours: see `radius`.
        strip: height above the lowest points that is left out as ground, metres; for readers
            that have not already done so.
    """

    kind: Literal["partial", "mirrored"] = "partial"
    outliers: Literal["statistical", "radius", "none"] = "statistical"
    radius: float = 0.15
    neighbours: int = 8
    strip: float = 0.0

    def with_shape(self, track: Track) -> Track | None:
        """The track with its shape, thinned to the density of `shape_partial`.

        None where there is nothing to build it from: no poses, or no point that is left.
        """
        if track.T_sensor_object is None:
            return None
        points = self._clean(fuse_by_truth(track))
        if self.kind == "mirrored":
            points = mirrored(points)
        return replace(track, shape=voxel_thin(points, VOXEL_M)) if len(points) else None

    def _clean(self, points: Points) -> Points:
        if self.outliers == "statistical":
            points = points[statistical_inliers(points)]
        elif self.outliers == "radius":
            points = points[radius_inliers(points, self.radius, self.neighbours)]
        if self.strip <= 0 or not len(points):
            return points
        # Not the very lowest: one stray point must not be what ground is measured from.
        floor = np.quantile(points[:, 2], _LOWEST) + self.strip
        return points[points[:, 2] >= floor]
