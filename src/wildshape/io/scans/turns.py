# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whole turns of a LiDAR from scan files, with the times of their points."""

from pathlib import Path

import numpy as np

from wildshape.io.scans.arrays import read_npy_field
from wildshape.io.scans.las import read_las_field
from wildshape.io.scans.pcd import read_pcd_field
from wildshape.io.scans.ply import read_ply_property
from wildshape.io.scans.point_times import TIME_FIELDS, seconds_since
from wildshape.io.scans.points import (
    SENSOR_METRES,
    check_near,
    drop_nonfinite,
    is_finite,
    read_all,
)
from wildshape.records import Turn

FIELDS = {
    ".ply": read_ply_property,
    ".pcd": read_pcd_field,
    ".npy": read_npy_field,
    ".las": read_las_field,
    ".laz": read_las_field,
}
"""By suffix: what reads a field of each point."""


def read_turn(path: Path, scan_time: float | None) -> Turn:
    """A whole scan, and when its points were taken, if a PLY, PCD, LAS, LAZ or .npy says so.

    `scan_time`: of the scan, seconds, if known.

    Raises:
        BadInputError: as `read_points`.
    """
    points = read_all(path, SENSOR_METRES)
    check_near(points, str(path))
    read_clock = FIELDS.get(path.suffix.lower())
    clock = None if read_clock is None else read_clock(path, TIME_FIELDS)
    if clock is None:
        return Turn(drop_nonfinite(points).points)
    kept = is_finite(points)
    whole = np.ascontiguousarray(points[kept], np.float32)
    clock = clock[kept]
    returned = whole.any(axis=1) | (clock != 0)  # what did not come back may have zeros alone
    seconds = seconds_since(clock[returned], scan_time)
    if seconds is None:
        return Turn(whole)
    every = np.full(len(whole), float(seconds.mean()))
    every[returned] = seconds
    return Turn(whole, every)
