# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Labels in KITTI tracking's layout, with what lies beside them."""

import math

import numpy as np
import pytest
from tests.datasets.street import SIZE, moved, street
from tests.datasets.write_kitti_tracking import EYE, IDS, T_EGO_VELO, write_sequence
from tests.refusal import refused

from wildshape.evaluation.drives.labels import Counting, read_labels

SCANS = 4


@pytest.fixture
def training(tmp_path):
    """A sequence whose camera has a picture, and whose scans begin at number 0."""
    scene = street(SCANS, points=3000, eye=EYE)
    folder = write_sequence(tmp_path / "training", scene, oxts=True)
    path = folder / "calib" / "0001.txt"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("P2")]
    projection = "P2: 721.5 0 609.6 0 0 721.5 172.9 0 0 0 1 0"
    path.write_text("\n".join([projection, *lines]) + "\n")
    return folder


def test_boxes_points_and_trajectory(training):
    (training / "label_02" / "._0001.txt").touch()  # of an archive made on a Mac
    truth = read_labels(training, Counting(range_m=math.inf, points=1))
    assert len(truth.frames) == len(truth.scans) == SCANS
    assert {label.track for label in truth.frames[0].labels} == set(IDS.values())
    assert truth.T_world_sensor is not None
    assert len(truth.T_world_sensor) == SCANS
    assert truth.view is not None
    label = truth.frames[1].labels[0]
    assert label.vehicle
    assert label.counted == truth.view.sees(label.box)
    np.testing.assert_allclose(truth.frames[0].regions, [[505.05, 167.89, 564.47, 197.36]])


def test_boxes_their_points_and_the_way_are_where_the_street_has_them(training):
    """By plain matrices, in the LiDAR's frame."""
    scene = street(SCANS, points=3000, eye=EYE)
    T_world_velo = [T @ T_EGO_VELO for T in scene.T_world_ego]
    truth = read_labels(training, Counting(range_m=math.inf, points=1))
    things = {track: thing for thing, track in IDS.items()}
    for i, frame in enumerate(truth.frames):
        for label in frame.labels:
            T_world_object = scene.T_world_object[things[label.track]][i]
            T = np.linalg.inv(T_world_velo[i]) @ T_world_object
            yaw = math.atan2(T[1, 0], T[0, 0])
            np.testing.assert_allclose(label.box, (*T[:3, 3], *SIZE, yaw), atol=1e-3)
            own = moved(np.linalg.inv(T_world_object), scene.clouds[i])
            inside = int((np.abs(own) < np.array(SIZE) / 2 + 1e-3).all(1).sum())
            for points, counts in ((inside // 2, label.counted), (2 * inside, False)):
                labels = read_labels(training, Counting(points, math.inf)).frames[i].labels
                assert {one.track: one.counted for one in labels}[label.track] == counts
    way = [np.linalg.inv(T_world_velo[0]) @ T for T in T_world_velo]
    found = truth.T_world_sensor
    assert found is not None
    np.testing.assert_allclose((found[0].inverse() @ found).matrix, way, atol=1e-3)


def test_few_points_and_what_is_far_or_unseen_does_not_count(training):
    near = read_labels(training, Counting(range_m=1.0, points=0))
    assert not any(label.counted for frame in near.frames for label in frame.labels)
    few = read_labels(training, Counting(range_m=math.inf, points=10**6))
    assert not any(label.counted for frame in few.frames for label in frame.labels)


def test_other_things_are_no_vehicles(training):
    path = training / "label_02" / "0001.txt"
    path.write_text(path.read_text().replace(f" {IDS['moving']} Car", f" {IDS['moving']} Tram"))
    labels = read_labels(training).frames[0].labels
    assert {label.track: label.vehicle for label in labels}[IDS["moving"]] is False
    assert not any(label.counted for label in labels if not label.vehicle)


def test_frames_are_the_scans_in_their_order(training):
    """A missing scan is no frame: as `wildshape drive` counts."""
    (training / "velodyne" / "0001" / "000001.bin").unlink()
    (training / "oxts" / "0001.txt").unlink()
    truth = read_labels(training / "label_02" / "0001.txt")
    assert [int(scan.stem) for scan in truth.scans] == [0, 2, 3]
    assert len(truth.frames) == 3
    assert truth.T_world_sensor is None


def _broken(training, what):
    calibration, labels = training / "calib" / "0001.txt", training / "label_02" / "0001.txt"
    match what:
        case "no P2":
            text = calibration.read_text()
            calibration.write_text("\n".join(x for x in text.splitlines() if x[:2] != "P2"))
        case "no scans":
            for scan in (training / "velodyne" / "0001").glob("*.bin"):
                scan.unlink()
        case "no calibration":
            calibration.unlink()
        case "two sequences":
            (labels.parent / "0002.txt").write_text("")
        case "short oxts":
            path = training / "oxts" / "0001.txt"
            path.write_text(path.read_text().splitlines()[0] + "\n")
        case "a region of words":
            labels.write_text("0 -1 DontCare -1 -1 -10 a b c d" + " -1" * 7 + "\n")


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("no P2", "no P2"),
        ("no scans", "no .bin scans"),
        ("no calibration", "no such file"),
        ("two sequences", "2 sequences"),
        ("short oxts", "1 lines"),
        ("a region of words", "KITTI tracking's labels"),
    ],
)
def test_what_is_missing_is_said(training, what, said):
    _broken(training, what)
    refused(read_labels, training, match=said)


def test_a_folder_without_labels(tmp_path):
    refused(read_labels, tmp_path, match="no label_02")
