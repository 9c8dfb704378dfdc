# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Detections of keyframes alone, and detections that hold the same points."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.drives.cuts import write_cut

import wildshape
from wildshape.drives.clock import Clock, silent
from wildshape.drives.config import DetectionConfig, DriveConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.source import Drive
from wildshape.drives.tracking.box_cutter import BoxCutter, check_cut, cut_boxes
from wildshape.drives.tracking.detections import DetectionFile, Detections, find_detections
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.tracking.segmentation import read_cuts
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detector import DetectorBox, upright_box
from wildshape.parallel.team import ALONE
from wildshape.records import Turn

SIZE = (4.0, 2.0, 1.5)


def box(x, score=None, category="Car"):
    return DetectorBox(0, category, None, upright_box((x, 0.0, 0.0), SIZE, 0.0), score)


def points_of(x, count=40):
    random = np.random.default_rng(int(10 * x))
    return (np.array((x, 0, 0)) + random.uniform(-0.5, 0.5, (count, 3)) * SIZE).astype(np.float32)


def cut(boxes, scan, *, tracked):
    heights = np.ones(len(scan))
    return cut_boxes(scan, boxes, heights, DriveConfig(), scan, tracked=tracked)


def test_a_vehicle_found_as_car_and_as_truck_has_each_of_its_points_once():
    """They were two tracks in one place, put together with every point twice."""
    scan = np.concatenate((points_of(0.0), points_of(10.0)))
    boxes = box(0.1, 0.6, "Truck"), box(0.0, 0.9), box(10.0), box(10.0)
    found = cut(boxes, scan, tracked=False)
    assert found.counts.tolist() == [40, 40]
    assert sorted(found.rows.tolist()) == list(range(80))
    assert sorted(found.rows[:40].tolist()) == list(range(40))
    assert cut(boxes, scan, tracked=True).counts.tolist()[1:] == [40, 40, 40]


def test_a_point_in_the_boxes_of_two_neighbours_is_the_surer_one_s():
    scan = np.concatenate((points_of(0.0, 400), points_of(3.5, 400)))
    found = cut((box(0.0, 0.5), box(3.5, 0.8)), scan, tracked=False)
    assert len(found.counts) == 2
    assert len(np.unique(found.rows)) == len(found.rows) == 800
    assert (scan[found.rows[: found.counts[0]], 0] <= 1.5).all()


@pytest.mark.parametrize("step", [1, 5])
def test_a_vehicle_detected_in_keyframes_alone_is_followed(tmp_path: Path, step):
    """At a tenth of a second: with every fifth scan all tracks broke off, without a word."""
    scans, speed = 31, 0.8
    frames = tuple((box(speed * f),) if f % step == 0 else () for f in range(scans))
    known = Detections(Path("boxes.json"), frames, tracked=False, warnings=())
    assert known.every == step
    for frame, row in enumerate(frames):
        clusters = [points_of(0.0) + np.array([speed * frame, 0, 0], np.float32) for _ in row]
        write_cut(tmp_path / "stages" / "clusters", frame, clusters, 100)
    names, nothing = [f"{frame:06d}" for frame in range(scans)], np.empty((0, 3), np.float32)
    drive = Drive.of("street", names, lambda _: Turn(nothing), [0.1 * f for f in range(scans)])
    predictor = wildshape.load()  # nothing is completed
    run = Pipeline(drive, tmp_path, DriveConfig(), predictor, ALONE, known, Clock(silent))
    (found,) = run.linked(SE3.identity(scans))
    assert found.frames == tuple(range(0, scans, step))
    check_cut(known, read_cuts(run.cuts, scans))


def test_a_gap_among_keyframes_is_not_their_usual_step():
    frames = tuple((box(0.0),) if f in (0, 2, 4, 20, 22) else () for f in range(30))
    assert Detections(Path("boxes.json"), frames, tracked=False, warnings=()).every == 2


@pytest.mark.parametrize("count", [15, 16])
def test_a_box_of_sixteen_points_is_cut_out(count):
    found = cut((box(0.0),), points_of(0.0, count), tracked=False)
    assert found.counts.tolist() == [16] * (count == 16)


def test_boxes_that_led_to_nothing_and_scans_without_are_counted():
    frames = (box(0.0), box(10.0)), (), (box(0.0),)
    known = Detections(Path("boxes.json"), frames, tracked=False, warnings=())
    assert known.told(3, 3) == ["1 of 3 scans have no detections"]
    assert known.told(2, 2)[1].startswith("1 of 3 detections are left out: they hold too few")
    assert known.told(3, 1)[1:] == [
        "2 of 3 detections are left out: without tracks of their own, they follow each other in too"
        " few scans"
    ]
    assert known.told(1, 1)[1:] == [
        "2 of 3 detections are left out: they hold too few points or those of another"
    ]
    assert Detections(Path("boxes.json"), frames[:1], tracked=True, warnings=()).told(2, 2) == []


def test_labels_of_kitti_without_a_calibration_say_which_camera_is_assumed(tmp_path: Path):
    """Of KITTI's own sensors boxes then lie 27 cm off; that was not said."""
    path = tmp_path / "0001.txt"
    path.write_text("0 1 Car 0 0 0 -1 -1 -1 -1 1.5 2 4 0 1 10 0\n")
    calibration = tmp_path / "calib.txt"
    calibration.write_text(
        "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"
    )
    drive = Drive.of("street", ["000000"], lambda _: Turn(np.empty((0, 3), np.float32)))
    (said,) = find_detections(DetectionFile(path), drive).warnings
    assert said.startswith("0001.txt is taken to be of a camera at the LiDAR's own place")
    assert find_detections(DetectionFile(path, calibration), drive).warnings == ()
    noted = find_detections(DetectionFile(path), drive).noted(replace(drive, warnings=("odd",)))
    assert (noted.warnings, noted.cut_by) == (("odd", said), "by the boxes of 0001.txt")


def test_other_boxes_scores_or_calibration_do_not_go_on_with_an_output(tmp_path: Path):
    path, calibration = tmp_path / "boxes.json", tmp_path / "calib.txt"
    path.write_text("[]")
    calibration.write_text("1")
    plain = DetectionFile(path)
    given = plain, DetectionFile(path, calibration), replace(plain, least_score=0.0)
    said = [one.identity() for one in (*given, replace(plain, least_score=0.3))]
    calibration.write_text("2")
    said.append(given[1].identity())
    path.write_text("[ ]")
    said.append(plain.identity())
    assert all(one not in said[:place] for place, one in enumerate(said))
    assert plain.identity() == said[-1]


@pytest.mark.parametrize("named", ["{}", "sweeps/{}", "sweeps/{}.bin"])
def test_boxes_at_times_that_the_drive_does_not_have_are_of_none_of_its_scans(tmp_path, named):
    """Those of 2.0 to 2.9 s lay on scan 2 of a drive of one second."""
    names = [f"{0.1 * frame:.1f}" for frame in range(30)]
    car = {"boxes_lidar": [[9.0, 0, 0, 4, 2, 1, 0]], "name": ["Car"]}
    path = tmp_path / "boxes.json"
    path.write_text(json.dumps([{**car, "frame_id": named.format(name)} for name in names]))
    drive = Drive.of("street", names[:10], lambda _: Turn(np.empty((0, 3), np.float32)))
    found = find_detections(DetectionFile(path), drive)
    assert [len(row) for row in found.frames] == [1] * 10
    assert found.warnings == ("20 detections belong to scans that the drive does not have",)


@pytest.mark.parametrize("yaw", [0.0, 1.0, 2.5])
def test_boxes_of_a_drive_stand_on_the_ground_of_a_tilted_sensor(yaw, tmp_path: Path):
    """They leaned with it, and lost a quarter of a vehicle's points."""
    mounting = Mounting(1.7, 24.0, (0.3, -0.28, math.sqrt(1 - 0.3**2 - 0.28**2)))
    T_sensor_level = mounting.levelling().inverse()
    T_level_box = SE3(rotation_z(torch.tensor(yaw).double()), torch.tensor((12.0, 3, -1)).double())
    T_sensor_box = T_sensor_level @ T_level_box
    points = T_sensor_box.apply_numpy(points_of(0.0, 400))
    ahead = T_sensor_box.rotation[:, 0]
    given = upright_box(
        T_sensor_box.translation.tolist(), SIZE, float(torch.atan2(ahead[1], ahead[0]))
    )
    frames = ((DetectorBox(0, "", "0001", given),),)
    known = Detections(Path("boxes.csv"), frames, tracked=True, warnings=(), corrected=True)
    drive = Drive.of("street", ["000000"], lambda _: Turn(points))
    config = replace(DriveConfig(), detections=DetectionConfig(around_m=1e-3))
    cutter = BoxCutter(drive, mounting, tmp_path, config, known)
    assert cutter.cut(0, points, np.ones(400), points).counts.tolist() == [400]
