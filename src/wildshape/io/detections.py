# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of many scans as one list, and as the JSON that needs no other project's conventions."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from wildshape.geometry.rotation import quaternion_from_rotation, rotation_from_quaternion
from wildshape.geometry.se3 import SE3
from wildshape.io.atomic import write_json
from wildshape.records import Box, SensorKind

FRAME = (
    "centre and quaternion (w, x, y, z; box to frame) in each scan's own sensor frame, metres; "
    "size along the box's own x (forward), y (left), z (up)"
)


@dataclass(frozen=True)
class Detection:
    """One object in one scan.

    Attributes:
        track: name of the object.
        track_number: of the object among all that are written, from 0.
        scan: name.
        scan_number: the scan's name where that is a whole number, else its place in the track.
        category: for example `car`; empty if unknown.
        sensor: tells the axes of the frame.
        score: confidence, 0 to 1.
        box: in the scan's sensor frame.
    """

    track: str
    track_number: int
    scan: str
    scan_number: int
    category: str
    sensor: SensorKind
    score: float
    box: Box


def pose_of(box: Box) -> SE3:
    """`T_sensor_box`, float64; origin at the box's centre."""
    wxyz = torch.tensor(box.quaternion_wxyz, dtype=torch.float64)
    return SE3(rotation_from_quaternion(wxyz), torch.tensor(box.centre, dtype=torch.float64))


def moved(box: Box, T_target_sensor: SE3) -> Box:
    """The same box in another frame."""
    T = T_target_sensor.to(pose_of(box).rotation.dtype) @ pose_of(box)
    x, y, z = T.translation.tolist()
    qw, qx, qy, qz = quaternion_from_rotation(T.rotation).tolist()
    return Box((x, y, z), box.size, (qw, qx, qy, qz))


def number_of(scan: str, place: int) -> int:
    """What a scan's name counts, or else its place in the track."""
    return int(scan) if scan.isascii() and scan.isdigit() else place


def write_box_list(path: Path, detections: Sequence[Detection]) -> None:
    """Write all boxes as one JSON object, atomically."""
    rows = [{**asdict(one), **asdict(one.box)} for one in detections]
    for row in rows:
        del row["box"]
    write_json(path, {"format": 1, "frame": FRAME, "boxes": rows})
