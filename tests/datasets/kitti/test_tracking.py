# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sequence written here in KITTI tracking's own layout, with known cars."""

import numpy as np
import pytest
from tests.cars import off_surface, poses_of
from tests.datasets.street import street
from tests.datasets.write_kitti_tracking import EYE, T_EGO_VELO, write_sequence
from tests.refusal import refusal_of

from wildshape.datasets.kitti.tracking import KittiTracking
from wildshape.datasets.kitti.tracking_labels import read_boxes
from wildshape.datasets.tracks.selection import Selection

FRAMES = 5
NAMES = {"parked": "0001_0003", "moving": "0001_0012"}


@pytest.fixture(scope="module")
def scene():
    return street(FRAMES, points=2500, eye=EYE)


@pytest.fixture
def training(scene, tmp_path):
    return write_sequence(tmp_path / "kitti" / "training", scene)


def tracks(root, **options):
    source = KittiTracking(root, **options)
    return {track.name: track for part in source.parts() for track in source.tracks_of(part)}


@pytest.mark.parametrize("colon", [":", ""])
def test_points_land_back_on_the_cars(scene, tmp_path, colon):
    """Both spellings of the calibration: R0_rect: and R_rect."""
    found = tracks(write_sequence(tmp_path / "training", scene, colon=colon))
    assert set(found) == set(NAMES.values())
    for name, track in NAMES.items():
        poses = poses_of(found[track])
        assert found[track].scan_names == tuple(f"{i:06d}" for i in range(FRAMES))
        assert found[track].category == "car"
        for i, scan in enumerate(found[track].scans):
            assert len(scan) > 500
            assert off_surface(poses[i].inverse().apply_numpy(scan)).max() < 1e-3
            T_velo_world = np.linalg.inv(scene.T_world_ego[i] @ T_EGO_VELO)
            expected = T_velo_world @ scene.T_world_object[name][i]
            assert np.asarray(poses[i]) == pytest.approx(expected, abs=1e-4)


def test_points_near_the_floor_are_left_out(training):
    for track in tracks(training).values():
        heights = poses_of(track)[0].inverse().apply_numpy(track.scans[0])[:, 2]
        assert heights.min() == pytest.approx(0.2 - 1.5 / 2, abs=0.02)


def test_motion_is_not_known_without_oxts(training):
    source = KittiTracking(training, Selection(motion="parked"))
    assert list(source.tracks_of("0001")) == []
    assert source.rejected == {"object: not known whether it moves": 2}


@pytest.mark.parametrize("motion", ["parked", "moving"])
@pytest.mark.parametrize("colon", [":", ""])
def test_motion_is_known_by_oxts(scene, tmp_path, motion, colon):
    """The ego drives 8 m meanwhile, the moving car 6 m; a wrong chain makes both move."""
    training = write_sequence(tmp_path / "training", scene, oxts=True, colon=colon)
    assert list(tracks(training, selection=Selection(motion=motion))) == [NAMES[motion]]


def test_oxts_puts_a_parked_car_in_one_place(scene, tmp_path):
    from wildshape.datasets.kitti.tracking import _open

    training = write_sequence(tmp_path / "training", scene, oxts=True)
    sequence, parked = _open(training, "0001"), poses_of(tracks(training)[NAMES["parked"]])
    places = np.array([sequence._place(i, parked[i]) for i in range(FRAMES)], dtype=float)
    assert np.ptp(places, axis=0) == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("level", range(2))
def test_root_may_be_training_or_above(training, level):
    assert len(tracks((training, training.parent)[level])) == 2


def test_frames_without_a_scan_and_other_types_are_counted(training):
    (training / "velodyne" / "0001" / "000002.bin").unlink()
    labels = training / "label_02" / "0001.txt"
    labels.write_text(labels.read_text().replace(" 12 Car ", " 12 Cyclist "))
    source = KittiTracking(training)
    (track,) = source.tracks_of("0001")
    assert track.scan_names == ("000000", "000001", "000003", "000004")
    assert source.rejected == {
        "scan: the frame has no LiDAR file": 1,
        "object: category Cyclist": 1,
    }
    (cyclist,) = KittiTracking(training, Selection(categories=("Cyclist",))).tracks_of("0001")
    assert (cyclist.name, cyclist.category) == ("0001_0012", "cyclist")


def test_a_file_whose_name_is_no_number_is_no_scan(training):
    """`²` is a digit to Python's isdigit, and none to int."""
    (training / "velodyne" / "0001" / "².bin").touch()
    assert set(tracks(training)) == set(NAMES.values())


def test_an_object_unlabelled_for_a_while_stays_one(training):
    labels = training / "label_02" / "0001.txt"
    lines = labels.read_text().splitlines(keepends=True)
    labels.write_text("".join(line for line in lines if not line.startswith(("1 3 ", "2 3 "))))
    found = tracks(training)
    assert sorted(found) == sorted(NAMES.values())
    assert found["0001_0003"].scan_names == ("000000", "000003", "000004")


def test_objects_are_handed_out_right_after_their_last_frame(training):
    labels = training / "label_02" / "0001.txt"
    lines = labels.read_text().splitlines(keepends=True)
    labels.write_text("".join(line for line in lines if not line.startswith(("3 3 ", "4 3 "))))
    scan = training / "velodyne" / "0001" / "000003.bin"
    scan.write_bytes(b"broken")
    source = KittiTracking(training)
    stream = source.tracks_of("0001")
    assert next(stream).name == "0001_0003"
    scan.unlink()
    assert "000003" not in next(stream).scan_names
    assert list(stream) == []
    assert source.rejected == {f"scan: {scan}: no such file; check the path.": 1}


def test_dontcare_is_no_object(training):
    boxes = read_boxes(training / "label_02" / "0001.txt")
    assert len(boxes) == 2 * FRAMES
    assert {box.track for box in boxes} == {3, 12}


refused = refusal_of(tracks)


def test_a_wrong_root_says_what_was_expected_and_found(tmp_path):
    refused(tmp_path / "nowhere", "nowhere: no such folder; give KITTI tracking's folder with")
    (tmp_path / "testing").mkdir()
    refused(tmp_path, r"found testing; give KITTI tracking's folder with training.label_02")
    (tmp_path / "label_02").mkdir()
    refused(tmp_path, "label_02: no labels; KITTI tracking's label archive")


def test_missing_and_damaged_calibration_is_named(training):
    path = training / "calib" / "0001.txt"
    good = path.read_text()
    path.write_text(good.replace("R0_rect", "R1_rect"))
    refused(training, r"calib.0001\.txt: found P0 .* expected a line R0_rect")
    path.write_text(good.replace("R0_rect:", "R0_rect: 1.0"))
    refused(training, r"calib.0001\.txt: R0_rect has 10 numbers, expected 12 or 9")
    path.write_text(good.replace("e-", "x-"))
    refused(training, r"calib.0001\.txt, line 1: expected numbers|line 5: expected numbers")
    path.unlink()
    refused(training, r"calib.0001\.txt: no such file; KITTI tracking's calibration archive")


def test_damaged_labels_are_named(training):
    path = training / "label_02" / "0001.txt"
    good = path.read_text()
    path.write_text(good.replace(" Car ", " Spaceship ", 1))
    refused(training, r"0001\.txt, line 2: type 'Spaceship' is none of KITTI tracking's")
    path.write_text(good[:-30])
    refused(training, r"0001\.txt, line 11: 1\d fields, expected 17")
    path.write_text(good.replace("1.700000", "wide", 1))
    refused(training, r"0001\.txt, line 2: a field is no number")
    path.write_text(good.replace(good.splitlines()[1].split()[-1], "90.0"))
    refused(training, r"0001\.txt, line 2: .* turn 90\.0 radians")
    path.write_text(good + good.splitlines()[1] + "\n")
    refused(training, r"0001\.txt, line 12: object \d+ has a box in frame 0 already")
    path.write_text(good)
    refused(training, "'Tank' is no type", selection=Selection(categories=("Tank",)))


def test_missing_scans_and_damaged_oxts_are_named(scene, tmp_path):
    training = write_sequence(tmp_path / "training", scene, oxts=True)
    path = training / "oxts" / "0001.txt"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:2]))
    refused(training, r"oxts/0001\.txt: 2 lines, but the labels know a frame 2")
    path.write_text(lines[0] + "1 2 3\n")
    refused(training, r"oxts.0001\.txt, line 2: expected 30 numbers")
    path.write_text(lines[0] + "90.5 " + lines[0].partition(" ")[2])
    refused(training, r"oxts.0001\.txt, line 2: expected 30 numbers")
    path.write_text("")
    refused(training, r"oxts.0001\.txt: is empty")
    path.unlink()
    for scan in (training / "velodyne" / "0001").iterdir():
        scan.unlink()
    refused(training, r"velodyne.0001: no \.bin scans")


def test_a_sequence_of_which_no_scan_can_be_read_is_refused(training):
    for scan in (training / "velodyne" / "0001").iterdir():
        scan.write_bytes(scan.read_bytes()[:-5])
    refused(training, r"000000\.bin: \d+ bytes, expected a multiple of 16")
