# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Five published full scans, where they are at hand: every labelled car is found."""

import math
from pathlib import Path

import numpy as np
import pytest

import wildshape
from wildshape.datasets.kitti.calibration import read_calibration, rigid
from wildshape.geometry.footprint import footprint_iou
from wildshape.io.boxes.table import read_box_table

ROOT = Path(__file__).parents[2].parent / "shared" / "data" / "real" / "kitti_tracking"
TRAINING = ROOT / "training"
FIRST = 328
pytestmark = pytest.mark.skipif(
    not TRAINING.is_dir(), reason="KITTI tracking's scans are not in ../shared/data: not run"
)


def labelled_cars():
    """Frame, centre and yaw, and size of each labelled car with 100 points or more."""
    known = read_calibration(TRAINING / "calib" / "0001.txt", "KITTI's archive brings it")
    T_rect_camera = rigid(known, ("R0_rect", "R_rect"), TRAINING)
    T_camera_velo = rigid(known, ("Tr_velo_to_cam", "Tr_velo_cam"), TRAINING)
    T_velo_rect = np.asarray((T_rect_camera @ T_camera_velo).inverse())
    for line in (TRAINING / "label_02" / "0001.txt").read_text().splitlines():
        words = line.split()
        frame = int(words[0]) - FIRST
        if not 0 <= frame < 5 or words[2] != "Car":
            continue
        height, width, length, x, y, z, turn = map(float, words[10:17])
        middle = T_velo_rect @ (x, y - height / 2, z, 1.0)
        ahead = T_velo_rect[:3, :3] @ (math.cos(turn), 0.0, -math.sin(turn))
        box = np.array((*middle[:3], math.atan2(ahead[1], ahead[0])))
        if points_inside(frame, box, (length, width, height)) >= 100:
            yield frame, box, (length, width, height)


def points_inside(frame, box, size):
    name = f"{FIRST + frame:06d}.bin"
    scan = np.fromfile(TRAINING / "velodyne" / "0001" / name, "<f4").reshape(-1, 4)[:, :3]
    c, s = math.cos(box[3]), math.sin(box[3])
    own = (scan - box[:3]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return int((np.abs(own) < np.array(size) / 2).all(axis=1).sum())


def test_every_labelled_car_of_100_points_has_one_box_in_its_place(tmp_path):
    found = wildshape.drive(TRAINING / "velodyne" / "0001", tmp_path / "out")
    rows = read_box_table(found.out / "boxes.csv")
    labels = list(labelled_cars())
    assert len(labels) >= 25
    for frame, box, size in labels:
        shares = [
            footprint_iou(
                np.array((row.x, row.y, row.z, row.yaw)), (row.length, row.width), box, size
            )
            for row in rows
            if row.frame == frame
        ]
        assert max(shares) > 0.5, (frame, box)
        assert sum(share > 0.3 for share in shares) == 1, (frame, box)
