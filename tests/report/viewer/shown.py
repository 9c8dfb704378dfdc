# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A car driven past, and what a model without error would make of its scans."""

import numpy as np
from tests.cars import car_surface, drive_by, poses_of

from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.records import Box, Track
from wildshape.report.viewer.sources import CompletedScan, Source

SIZE = (4.2, 1.7, 1.35)


def track(scans: int = 5, name: str = "car <b>") -> Track:
    return drive_by(name, scans=scans, points=300)


def perfect(shown: Track, scan: int) -> CompletedScan:
    """The true pose as the learned one, and the true surface."""
    pose = poses_of(shown)[scan]
    w, x, y, z = quaternion_from_rotation(pose.rotation).tolist()
    cx, cy, cz = pose.translation.tolist()
    points = pose.apply_numpy(car_surface(600)[0].astype(np.float32))
    return CompletedScan(points, Box((cx, cy, cz), SIZE, (w, x, y, z)), pose, 0.8, seconds=0.01)


def source(scans: int = 5) -> Source:
    shown = track(scans)

    def make(number: int, given: Track, first: int):
        for scan in (first, *(i for i in range(scans) if i != first)):
            yield scan, perfect(given, scan)

    return Source("test", ("one", "two"), lambda _: shown, make)
