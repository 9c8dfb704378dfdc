# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines that look at nothing but the points' mean, or at nothing at all (METHOD 8, 9)."""

from collections.abc import Sequence

import numpy as np
import torch

from wildshape.geometry.se3 import SE3
from wildshape.records import Points, Sensor


def fuse(scans: Sequence[Points], T_middle_scan: SE3) -> Points:
    """All scans moved and put together, `(m, 3)` in the middle scan's frame."""
    moved = [T_middle_scan[i].apply_numpy(scan) for i, scan in enumerate(scans)]
    return np.concatenate(moved)


class Identity:
    """Centroids aligned, rotation none: right on straight roads, and nowhere else."""

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:  # noqa: ARG002
        """`T_middle_scan`, one a scan."""
        centroids = torch.as_tensor(np.stack([scan.mean(axis=0, dtype=float) for scan in scans]))
        translation = centroids[len(scans) // 2] - centroids
        return SE3(SE3.identity(len(scans)).rotation, translation)

    def complete_track(self, scans: Sequence[Points], sensor: Sensor) -> Points:
        """The fused scans, `(m, 3)` in the middle scan's frame."""
        return fuse(scans, self.register_track(scans, sensor))


class OneScan:
    """The scan itself as its completion: what ICP has where it has only one scan."""

    def complete(self, points: Points, sensor: Sensor) -> Points:  # noqa: ARG002
        """`points`, unchanged."""
        return points
