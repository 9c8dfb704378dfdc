# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive written here in KITTI's own layout, with known points."""

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.cars import poses_of
from tests.datasets.damaged import passed_over
from tests.datasets.write_kitti_raw import SIZE, in_velo, write_drive
from tests.refusal import refusal_of

from wildshape.datasets.kitti.raw import KittiRaw
from wildshape.datasets.tracks.labelled_boxes import Crop
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.errors import BadInputError

POSES = [(10.0 - i, 4.0, -1.7, 0.5) for i in range(6)]


@pytest.fixture
def drive(tmp_path):
    rng = np.random.default_rng(0)
    clouds = {}
    for i, pose in enumerate(POSES):
        # z from the box's floor: 120 points above the strip, 30 in it, and the world around.
        on_car = rng.uniform((-2, -0.9, 0.25), (2, 0.9, 1.5), size=(120, 3))
        ground = rng.uniform((-2, -0.9, 0.0), (2, 0.9, 0.19), size=(30, 3))
        world = np.array([[2.3, 0, 1], [0, 1.2, 1], [0, 0, 1.8], [-30, 0, 1], [60, 70, 2]])
        clouds[3 + i] = in_velo(np.concatenate((on_car, ground, world)), pose)
    clouds[5] = clouds[5][:90]
    del clouds[7]
    tracklets = [
        ("Car", 3, POSES),
        ("Pedestrian", 3, POSES),
        ("Van", 3, [(40.0, -9.0, -1.7, 0.0)] * 2),
    ]
    root = tmp_path / "kitti"
    return write_drive(root / "2011_09_26" / "2011_09_26_drive_0099_sync", tracklets, clouds)


def test_a_vehicle_becomes_a_track(drive):
    source = KittiRaw(drive)
    (track,) = all_tracks(source)
    assert track.name == "2011_09_26_drive_0099_sync_0000"
    assert track.category == "car"
    assert track.scan_names == tuple(f"{frame:010d}" for frame in (3, 4, 6, 8))
    assert [len(scan) for scan in track.scans] == [120] * 4
    assert all(scan.dtype == np.float32 for scan in track.scans)
    assert source.rejected == {
        "object: category Pedestrian": 1,
        "scan: fewer than 100 points on the object": 3,
        "scan: the frame has no LiDAR file": 1,
        "object: fewer than 1 scans left": 1,
    }


def test_truth_has_its_origin_at_the_boxs_centre(drive):
    (track,) = all_tracks(KittiRaw(drive))
    poses = poses_of(track)
    for i, frame in enumerate((3, 4, 6, 8)):
        x, y, z, yaw = POSES[frame - 3]
        assert poses.translation[i].tolist() == pytest.approx([x, y, z + SIZE[2] / 2])
        # One metre ahead of, left of and above the centre.
        for axis in range(3):
            ahead = in_velo(np.eye(3)[axis] + [0, 0, SIZE[2] / 2], (x, y, z, yaw))
            assert poses[i].apply_numpy(np.eye(3)[axis : axis + 1]) == pytest.approx(ahead)
        local = poses[i].inverse().apply_numpy(track.scans[i])
        assert (np.abs(local) <= np.array(SIZE) / 2 + 1e-4).all()


def test_ground_margin_and_every(drive):
    (kept,) = all_tracks(KittiRaw(drive, crop=Crop(ground=-0.15)))
    assert len(kept.scans[0]) == 150
    # 0.35 m reaches the points 0.3 m beside, before and above the box.
    (wide,) = all_tracks(KittiRaw(drive, crop=Crop(margin=0.35)))
    assert len(wide.scans[0]) == 123
    (second,) = all_tracks(KittiRaw(drive, Selection(every=2, min_points=50)))
    assert second.scan_names == ("0000000003", "0000000005")
    assert list(all_tracks(KittiRaw(drive, Selection(min_scans=9)))) == []


@pytest.mark.parametrize("level", [0, 1, 2])
def test_root_may_be_a_drive_a_date_or_the_folder_above(drive, level):
    root = (drive, *drive.parents)[level]
    assert [track.name for track in all_tracks(KittiRaw(root))] == [f"{drive.name}_0000"]


def test_a_drive_has_its_name_and_calibration_where_one_stands_in_it(drive, monkeypatch):
    write_world(drive, forward=0.0)
    monkeypatch.chdir(drive)
    source = KittiRaw(Path(), Selection(motion="moving"))
    assert source.parts() == [drive.name]
    assert [track.name for track in all_tracks(source)] == [f"{drive.name}_0000"]


def test_cut_scans_stand_in_where_full_ones_are_missing(drive):
    (full,) = all_tracks(KittiRaw(drive))
    cut = {7: in_velo(np.random.default_rng(1).uniform(0.3, 0.8, (110, 3)), POSES[4])}
    cut[3] = np.zeros((1, 3))
    write_drive(drive, [("Car", 3, POSES)], cut, "velodyne_objects_xyz0")
    (track,) = all_tracks(KittiRaw(drive))
    assert track.scan_names[3] == "0000000007"
    assert np.array_equal(track.scans[0], full.scans[0])


def test_a_drive_without_labels_among_others_is_counted(drive):
    (drive.parent / "2011_09_26_drive_0100_sync" / "velodyne_points" / "data").mkdir(parents=True)
    source = KittiRaw(drive.parent)
    assert len(list(all_tracks(source))) == 1
    assert source.rejected["drive without tracklet_labels.xml"] == 1


refused = refusal_of(lambda root: list(all_tracks(KittiRaw(root))))


def test_missing_and_corrupt_files_are_named(drive):
    refused(drive / "nowhere", "nowhere: no such folder")
    labels = drive / "tracklet_labels.xml"
    good = labels.read_text()
    labels.write_text(good[:400])
    refused(drive, r"tracklet_labels\.xml: not valid XML")
    labels.write_text(good.replace("<tx>10.0</tx>", "<tx>nan</tx>", 1))
    refused(drive, r"tracklet_labels\.xml: tracklet 0: <tx> is 'nan'")
    labels.write_text(re.sub(r"<rz>.*?</rz>", "<rz>-90</rz>", good))
    refused(drive, r"tracklet_labels\.xml: tracklet 0: <rz> is 90, expected radians")
    labels.write_text("<a/>")
    refused(drive, r"tracklet_labels\.xml: holds no tracklets")
    labels.unlink()
    refused(drive, r"tracklet_labels\.xml: no such file")
    refused(drive.parent, "found 1 KITTI raw drives and none with")
    labels.write_text(good)
    scan = drive / "velodyne_points" / "data" / "0000000004.bin"
    scan.write_bytes(scan.read_bytes()[:-5])
    (track,) = passed_over(
        KittiRaw(drive), r"0000000004\.bin: \d+ bytes, expected a multiple of 16"
    )
    assert "0000000004" not in track.scan_names


def test_a_drive_without_scans_is_refused(tmp_path):
    drive = write_drive(tmp_path / "2011_09_26_drive_0001_sync", [("Car", 0, POSES)], {})
    refused(drive, r"velodyne_points.data: no \.bin scans")


T_VELO_IMU = "R: 0.8 -0.6 0 0.6 0.8 0 0 0 1\nT: -0.8 0.3 -0.8\n"


def write_world(drive, forward):
    """The vehicle drives north by `forward` metres a frame; its IMU heads there (yaw pi/2)."""
    (drive / "oxts" / "data").mkdir(parents=True)
    (drive.parent / "calib_imu_to_velo.txt").write_text("calib_time: now\n" + T_VELO_IMU)
    for frame in range(9):
        latitude = math.degrees(frame * forward / 6378137.0)
        record = [latitude, 0, 100, 0, 0, math.pi / 2] + [0] * 24
        path = drive / "oxts" / "data" / f"{frame:010d}.txt"
        path.write_text(" ".join(f"{value:.12f}" for value in record))
    (drive / "oxts" / "data" / "._0000000000.txt").write_text("left by macOS")


def moving(drive, motion):
    return len(list(all_tracks(KittiRaw(drive, Selection(motion=motion)))))


def test_moving_and_parked_are_told_in_the_world(drive):
    """The boxes recede by 1 m a frame along -x of the velodyne."""
    refused_motion = KittiRaw(drive, Selection(motion="parked"))
    with pytest.raises(BadInputError, match=r"oxts.data: no records"):
        list(all_tracks(refused_motion))
    write_world(drive, forward=0.0)
    assert (moving(drive, "moving"), moving(drive, "parked")) == (1, 0)
    # R takes the IMU's x to (0.8, 0.6, 0): a car that recedes along -x is none that stands still,
    # but with a calibration that does not turn it is, where the vehicle goes as fast.
    shutil.rmtree(drive / "oxts")
    write_world(drive, forward=1.0)
    assert moving(drive, "moving") == 1
    calibration = drive.parent / "calib_imu_to_velo.txt"
    calibration.write_text("R: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n")
    assert (moving(drive, "moving"), moving(drive, "parked")) == (0, 1)
    calibration.unlink()
    with pytest.raises(BadInputError, match=r"calib_imu_to_velo\.txt: no such file"):
        moving(drive, "parked")
