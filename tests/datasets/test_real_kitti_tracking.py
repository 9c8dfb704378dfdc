# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Published scans of KITTI tracking, where they are at hand, against what else can be known."""

from pathlib import Path

import numpy as np
import pytest
import torch
from tests.cars import poses_of

from wildshape.baselines.icp import LocalIcp
from wildshape.datasets.kitti.tracking import KittiTracking
from wildshape.datasets.tracks.labelled_boxes import Crop
from wildshape.datasets.tracks.truth import fuse_by_truth, shape_partial

ROOT = Path(__file__).parents[2].parent / "shared" / "data" / "real" / "kitti_tracking"
TRAINING = ROOT / "training"
pytestmark = pytest.mark.skipif(
    not TRAINING.is_dir(), reason="KITTI tracking's scans are not in ../shared/data: not run"
)


@pytest.fixture(scope="module")
def tracks():
    return list(KittiTracking(ROOT).tracks_of("0001"))


def test_six_cars_and_a_truck_of_five_frames(tracks):
    source = KittiTracking(ROOT)
    assert source.parts() == ["0001"]
    assert len(list(source.tracks_of("0001"))) == len(tracks) == 7
    counts = {track.name: len(track.scans) for track in tracks}
    assert counts == {
        f"0001_00{i}": n for i, n in zip((75, 76, 77, 78, 79, 80, 87), (5, 2, 5, 5, 5, 5, 1))
    }
    assert source.rejected["object: category Pedestrian"] == 3
    assert source.rejected["object: category Misc"] == 1
    # 2898 boxes of cars, vans and trucks, of which the piece has the scans of 30.
    labels = [
        line.split() for line in (TRAINING / "label_02" / "0001.txt").read_text().splitlines()
    ]
    boxes = [row for row in labels if row[2] in ("Car", "Van", "Truck")]
    missing = [row for row in boxes if not 328 <= int(row[0]) <= 332]
    assert source.rejected["scan: the frame has no LiDAR file"] == len(missing)


def matrix(name, columns):
    lines = (TRAINING / "calib" / "0001.txt").read_text().splitlines()
    numbers = next(line.split()[1:] for line in lines if line.startswith(name))
    T = np.eye(4)
    T[:3, :columns] = np.array(numbers, float).reshape(3, columns)
    return T


def test_boxes_hold_the_points_they_hold_in_the_cameras_frame():
    """Counted there with plain matrices, where the labels are; no margin, no strip."""
    T = matrix("R0_rect", 3) @ matrix("Tr_velo_to_cam", 4)
    plain = KittiTracking(ROOT, crop=Crop(margin=0.0, ground=0.0)).tracks_of("0001")
    found = {(t.name, n): len(s) for t in plain for n, s in zip(t.scan_names, t.scans)}
    assert len(found) > 25
    for line in (TRAINING / "label_02" / "0001.txt").read_text().splitlines():
        words = line.split()
        key = (f"0001_{int(words[1]):04d}", f"{int(words[0]):06d}")
        if key not in found:
            continue
        h, w, length, x, y, z, turn = map(float, words[10:17])
        raw = np.fromfile(TRAINING / "velodyne" / "0001" / f"{key[1]}.bin", "<f4").reshape(-1, 4)
        away = raw[:, :3].astype(float) @ T[:3, :3].T + T[:3, 3] - (x, y, z)
        along = np.cos(turn) * away[:, 0] - np.sin(turn) * away[:, 2]
        aside = np.sin(turn) * away[:, 0] + np.cos(turn) * away[:, 2]
        inside = (np.abs(along) < length / 2) & (np.abs(aside) < w / 2)
        inside &= (away[:, 1] < 0) & (away[:, 1] > -h)
        assert abs(found[key] - inside.sum()) <= 1


def test_boxes_agree_with_icp_on_well_seen_cars(tracks):
    """Within 10 cm at the car and 2 degrees: 12 of 13 pairs of over 300 points."""
    agree = {}
    for track in tracks:
        for i in range(len(track.scans) - 1):
            if len(track.scans[i]) < 300:
                continue
            T_box = poses_of(track)[i + 1] @ poses_of(track)[i].inverse()
            T_icp = LocalIcp().align(track.scans[i], track.scans[i + 1], track.sensor)
            middle = torch.as_tensor(track.scans[i].mean(axis=0, keepdims=True), dtype=torch.double)
            apart = float((T_icp.apply(middle) - T_box.apply(middle)).norm())
            turned = np.degrees(float((T_box.inverse() @ T_icp).angle()))
            agree[track.name, i] = apart < 0.1 and turned < 2
    assert len(agree) == 13
    # That one passes within 3.5 m and leaves the image: other parts of it come into sight.
    assert [key for key, good in agree.items() if not good] == [("0001_0076", 0)]


def test_accumulated_cars_look_like_cars(tracks):
    for track in (track for track in tracks if track.category == "car"):
        length, width, height = np.ptp(shape_partial(track), axis=0)
        assert 3 < length < 6
        assert 1.4 < width < 2.3
        assert 1.2 < height < 2.2


def test_crops_are_free_of_ground(tracks):
    """A strip of road would be most of the lowest 10 cm."""
    for track in tracks:
        heights = fuse_by_truth(track)[:, 2]
        assert (heights < heights.min() + 0.1).mean() < 0.15
