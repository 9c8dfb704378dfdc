# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines that look at nothing but the points' mean, or at nothing at all (METHOD 8, 9)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from wildshape.baselines.pairs import centroid
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.registration import fuse_scans
from wildshape.records import Points, Sensor


@dataclass(frozen=True)
class Identity:
    """Centroids aligned, rotation none: right on straight roads, and nowhere else."""

    @property
    def about(self) -> str:
        """The method in a line."""
        return "centroids aligned, no rotation"

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_middle_scan`, one a scan."""
        centroids = torch.as_tensor(np.stack([centroid(scan) for scan in scans]))
        translation = centroids[len(scans) // 2] - centroids
        return SE3(SE3.identity(len(scans)).rotation, translation)

    def complete_track(self, scans: Sequence[Points], sensor: Sensor) -> Points:
        """The fused scans, `(m, 3)` in the middle scan's frame."""
        return fuse_scans(scans, self.register_track(scans, sensor))


@dataclass(frozen=True)
class OneScan:
    """The scan itself as its completion: what ICP has where it has only one scan."""

    @property
    def about(self) -> str:
        """The method in a line."""
        return "the scan itself as its completion"

    def complete(self, points: Points, sensor: Sensor) -> Points:  # noqa: ARG002
        """`points`, unchanged."""
        return points
