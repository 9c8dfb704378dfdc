# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes written for KITTI, nuScenes and Argoverse 2 are what our readers take for those labels."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from pyarrow import feather
from tests.cars import poses_of
from tests.datasets.street import SIZE, street
from tests.datasets.write_argoverse2 import LOG, STAMPS, write_log
from tests.datasets.write_kitti_tracking import EYE, write_sequence
from tests.datasets.write_nuscenes import Scene, Thing, ego_pose, sensor_pose, write_nuscenes

from wildshape.datasets.argoverse2.log import read_boxes as read_argoverse2
from wildshape.datasets.argoverse2.log import read_sensor_pose
from wildshape.datasets.argoverse2.reader import Argoverse2
from wildshape.datasets.kitti.calibration import read_calibration, rigid
from wildshape.datasets.kitti.tracking import KittiTracking
from wildshape.datasets.kitti.tracking_labels import read_boxes
from wildshape.datasets.nuscenes.reader import NuScenes
from wildshape.errors import BadInputError, MissingExtraError
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.io.boxes.argoverse2 import write_argoverse2_boxes
from wildshape.io.boxes.detections import (
    Detection,
    detections_of,
    frame_numbers,
    number_of,
    read_detections,
    write_box_list,
)
from wildshape.io.boxes.kitti import KittiCamera, camera_at_the_lidar, write_kitti_labels
from wildshape.io.boxes.nuscenes import write_nuscenes_boxes
from wildshape.records import Box


def detections(tracks, size):
    """The true boxes of tracks, as a perfect method would find them."""
    return [
        Detection(
            track=track.name,
            track_number=i,
            scan=scan,
            scan_number=number_of(scan, k),
            category=track.category,
            sensor="lidar",
            score=0.75,
            box=true_box(poses_of(track)[k], size),
        )
        for i, track in enumerate(tracks)
        for k, scan in enumerate(track.scan_names)
    ]


def true_box(pose, size):
    x, y, z = pose.translation.tolist()
    qw, qx, qy, qz = quaternion_from_rotation(pose.rotation).tolist()
    return Box((x, y, z), tuple(size), (qw, qx, qy, qz))


def test_kitti_labels_come_back_as_the_labels_they_were_read_from(tmp_path):
    training = write_sequence(tmp_path / "training", street(4, points=2500, eye=EYE))
    tracks = list(KittiTracking(training).tracks_of("0001"))
    path = training / "calib" / "0001.txt"
    calibration = read_calibration(path, "")
    T_rect_velo = rigid(calibration, ("R0_rect",), path) @ rigid(
        calibration, ("Tr_velo_to_cam",), path
    )
    camera = KittiCamera(T_rect_velo, calibration["P2"].reshape(3, 4))
    expected = {(b.frame, b.track): b for b in read_boxes(training / "label_02" / "0001.txt")}
    written = write_kitti_labels(tmp_path / "out", detections(tracks, SIZE), camera)
    assert [file.name for file in written] == [f"{track.name}.txt" for track in tracks]
    for file, track in zip(written, tracks, strict=True):
        found = read_boxes(file)
        assert len(found) == len(track.scans)
        for box in found:
            same = expected[box.frame, int(track.name[-4:])]
            assert box.category == "Car"
            assert box.size == pytest.approx(same.size, abs=1e-4)
            assert np.asarray(box.T_rect_object) == pytest.approx(
                np.asarray(same.T_rect_object), abs=1e-4
            )
    assert {box.track for file in written for box in read_boxes(file)} == {0, 1}


def test_a_kitti_line_by_hand(tmp_path):
    # 10 m ahead and 2 m to the left of the LiDAR, 1 m under it, looking to the left.
    half = float(np.sqrt(0.5))
    box = Box((10.0, 2.0, -1.0), (4.0, 1.8, 1.6), (half, 0.0, 0.0, half))
    one = Detection("car", 7, "scan", 3, "", "lidar", 0.5, box)
    projection = np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]])
    camera = replace(camera_at_the_lidar(), projection=projection)
    (file,) = write_kitti_labels(tmp_path, [one], camera)
    words = file.read_text().split()
    assert words[:5] == ["3", "7", "Misc", "-1", "-1"]
    numbers = [float(word) for word in words[5:]]
    turn = -np.pi  # of the camera's x, to the right, about its y, down
    alpha = turn - np.arctan2(-2.0, 10.0) + 2 * np.pi
    near, far = 10 - 0.9, 10 + 0.9
    image = [600 - 700 * 4 / near, 180 + 700 * 0.2 / far, 600, 180 + 700 * 1.8 / near]
    expected = [alpha, *image, 1.6, 1.8, 4.0, -2.0, 1.8, 10.0, turn, 0.5]
    numbers[11] = -abs(numbers[11])  # a half turn has two names
    assert np.cos(numbers[0] - alpha) == pytest.approx(1)
    assert numbers[1:] == pytest.approx(expected[1:], abs=1e-4)
    # Rolled by two degrees: the line's box stands upright, and so does the image's.
    cos, sin = half * np.cos(np.radians(1.0)), half * np.sin(np.radians(1.0))
    rolled = replace(one, box=replace(box, quaternion_wxyz=(cos, sin, sin, cos)))
    (upright,) = write_kitti_labels(tmp_path / "rolled", [rolled], camera)
    again = [float(word) for word in upright.read_text().split()[5:]]
    assert again[1:11] == pytest.approx(numbers[1:11], abs=1e-4)
    # Half of it behind the camera: no place in the image.
    behind = replace(one, box=replace(box, centre=(0.5, 0.0, 0.0)))
    write_kitti_labels(tmp_path, [behind], camera)
    assert file.read_text().split()[6:10] == ["-1.000000"] * 4


@pytest.mark.parametrize("yaw", [0.7, 1.7, -1.2])
def test_the_image_box_of_a_turned_box_holds_its_corners(yaw, tmp_path):
    """Through a camera that stands beside the rectified frame's own, as KITTI's P2 does."""
    box = Box((10.0, 4.0, -1.0), (4.0, 1.8, 1.6), (np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)))
    one = Detection("car", 0, "0", 0, "car", "lidar", 1.0, box)
    projection = np.array([[700.0, 0, 600, 45], [0, 700, 180, 0.2], [0, 0, 1, 0.003]])
    camera = replace(camera_at_the_lidar(), projection=projection)
    (file,) = write_kitti_labels(tmp_path, [one], camera)
    alpha, *image = map(float, file.read_text().split()[5:10])
    rect = camera.T_rect_sensor.apply_numpy(box.corners.astype(np.float64))
    u, v, depth = projection @ np.column_stack((rect, np.ones(8))).T
    u, v = u / depth, v / depth
    assert image == pytest.approx([u.min(), v.min(), u.max(), v.max()], abs=1e-3)
    seen_from = -yaw - np.pi / 2 - np.arctan2(-4.0, 10.0)
    assert alpha == pytest.approx(np.remainder(seen_from + np.pi, 2 * np.pi) - np.pi, abs=1e-5)


def test_nuscenes_records_are_the_annotations_in_the_sensors_frame(tmp_path):
    car = Thing("car", velocity=(5.0, 3.0, 0.1), yaw_rate=0.3)
    written = write_nuscenes(tmp_path / "nuscenes", (Scene("scene-0061", (car,)),))
    (track,) = NuScenes(written, cache=tmp_path / "cache").tracks_of("scene-0061")
    write_nuscenes_boxes(tmp_path / "boxes.json", detections([track], car.size))
    results = json.loads((tmp_path / "boxes.json").read_text())["results"]
    labels = json.loads((written / "v1.0-mini" / "sample_annotation.json").read_text())
    assert list(results) == list(track.scan_names)
    for key, (scan, rows) in enumerate(results.items()):
        (row,) = rows
        rotation, translation = car.pose(0.5 * key)
        ego, calibration = ego_pose(0.5 * key), sensor_pose("LIDAR_TOP")
        to_global = ego[0] * calibration[0]
        at = to_global.apply(row["translation"]) + ego[0].apply(calibration[1]) + ego[1]
        assert at == pytest.approx(translation, abs=1e-4)
        w, x, y, z = row["rotation"]
        found = to_global.as_matrix() @ type(rotation).from_quat((x, y, z, w)).as_matrix()
        assert found == pytest.approx(rotation.as_matrix(), abs=1e-5)
        assert any(label["size"] == row["size"] for label in labels)
        assert row["sample_token"] == scan
        assert (row["detection_name"], row["tracking_id"]) == ("car", track.name)
        assert row["detection_score"] == row["tracking_score"] == 0.75


def test_an_argoverse2_table_comes_back_as_the_labels_it_was_read_from(tmp_path):
    root = tmp_path / "val"
    log = write_log(root / LOG, street(3, points=4000))
    source = Argoverse2(root)
    tracks = list(source.tracks_of(source.parts()[0]))
    T_ego_sensor = read_sensor_pose(log, "both")
    given = detections(tracks, SIZE)
    write_argoverse2_boxes(tmp_path / "out" / "annotations.feather", given, T_ego_sensor)
    found, labels = read_argoverse2(tmp_path / "out"), read_argoverse2(log)
    assert len(found.timestamps) == len(labels.timestamps) == 6
    rows = {(f"{LOG}_{track}", t): i for i, (track, t) in enumerate(_keys(labels))}
    for i, key in enumerate(_keys(found)):
        j = rows[key]
        assert found.sizes[i] == pytest.approx(labels.sizes[j])
        assert np.asarray(found.T_ego_object[i]) == pytest.approx(
            np.asarray(labels.T_ego_object[j]), abs=1e-4
        )
        assert found.categories[i] == labels.categories[j]
    write_argoverse2_boxes(tmp_path / "sensor" / "annotations.feather", given)
    there = read_argoverse2(tmp_path / "sensor").T_ego_object[0]
    assert there.translation.tolist() == pytest.approx(list(given[0].box.centre), abs=1e-5)
    assert found.timestamps.max() == STAMPS[2]


def test_categories_are_the_inputs_however_they_are_written(tmp_path):
    box = Box((10.0, 0.0, 0.0), (4.0, 2.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    kinds = ("Car", "car", "Cyclist", "person_sitting", "Bus", "")
    given = [Detection("a", 0, "7", 7, kind, "lidar", 0.5, box) for kind in kinds]
    write_argoverse2_boxes(tmp_path / "a.feather", given)
    found = feather.read_table(tmp_path / "a.feather").column("category").to_pylist()
    vehicle = "REGULAR_VEHICLE"
    assert found == [vehicle, vehicle, "CYCLIST", "PERSON_SITTING", "BUS", vehicle]
    (file,) = write_kitti_labels(tmp_path, given, camera_at_the_lidar())
    types = [line.split()[2] for line in file.read_text().splitlines()]
    assert types == ["Car", "Car", "Cyclist", "Person_sitting", "Misc", "Misc"]


@pytest.mark.parametrize("name", ["1700000000123456789", "315966265659927216"])
def test_argoverse2_has_the_time_that_a_scan_is_named_by(name, tmp_path):
    scan = {"scan": name, "confidence": 0.5, "box": json.loads(_BOX)}
    (of_track,) = detections_of({"track": "car", "scans": [scan]}, 0)
    of_drive = replace(of_track, sequence="drive", scan_number=frame_numbers([name])[0])
    path = tmp_path / "annotations.feather"
    write_argoverse2_boxes(path, [of_track, of_drive, replace(of_drive, time_ns=5)])
    stamps = feather.read_table(path).column("timestamp_ns").to_pylist()
    assert stamps == [int(name), int(name), 5]


def test_what_is_not_known_of_a_box_is_written_as_that(tmp_path):
    box = Box((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    bare = Detection("car", 0, "7", 7, "", "lidar", 0.5, box)
    given = [bare, replace(bare, category="car", points=9, velocity=(3.0, -1.0))]
    write_argoverse2_boxes(tmp_path / "a.feather", given)
    points = feather.read_table(tmp_path / "a.feather").column("num_interior_pts")
    assert points.to_pylist() == [-1, 9]
    write_nuscenes_boxes(tmp_path / "n.json", given)
    (rows,) = json.loads((tmp_path / "n.json").read_text())["results"].values()
    names = [(row["detection_name"], row["tracking_name"], row["velocity"]) for row in rows]
    assert names == [("object", "object", [0, 0]), ("car", "car", [3, -1])]


def test_an_argoverse2_table_without_boxes_has_the_types_of_one_with(tmp_path):
    box = Box((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    one = Detection("car", 0, "7", 7, "car", "lidar", 0.5, box)
    for name, given in (("none", []), ("one", [one])):
        write_argoverse2_boxes(tmp_path / name, given)
    none, some = (feather.read_table(tmp_path / name).schema for name in ("none", "one"))
    assert none.equals(some)
    assert str(none.field("category").type) == "string"


def _keys(boxes):
    return list(zip(boxes.tracks.tolist(), boxes.timestamps.tolist(), strict=True))


def test_without_pyarrow_one_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'wildshape\[arrow\]'"):
        write_argoverse2_boxes(tmp_path / "annotations.feather", [])
    assert not list(tmp_path.iterdir())


def test_json_holds_every_box_as_it_is(tmp_path):
    box = Box((1.0, 2.0, 3.0), (4.0, 1.8, 1.5), (1.0, 0.0, 0.0, 0.0))
    given = [Detection("a", 0, "000004", 4, "car", "lidar", 0.25, box)]
    write_box_list(tmp_path / "boxes.json", given)
    (row,) = json.loads((tmp_path / "boxes.json").read_text())["boxes"]
    assert Box(*(tuple(row[k]) for k in ("centre", "size", "quaternion_wxyz"))) == box
    assert (row["track"], row["scan"], row["score"]) == ("a", "000004", 0.25)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("000012", 12),
        ("00000000000000000000000012", 12),
        ("315966253660357000", 315966253660357000),
        (str(2**63 - 1), 2**63 - 1),
        (str(2**63), 5),  # no file has a column for it
        ("9" * 5000, 5),
        ("left", 5),
        ("-3", 5),
    ],
)
def test_the_number_of_a_scan_is_its_name_where_that_counts(name, number):
    assert number_of(name, 5) == number


def test_the_place_of_a_scan_counts_those_skipped_before_it():
    scans = [
        {"scan": f"scan_{place:02d}", "confidence": 0.5, "box": json.loads(_BOX)}
        for place in (0, 2, 4)
    ]
    skipped = [{"scan": f"scan_{place:02d}.ply", "reason": "few points"} for place in (1, 3, 5)]
    said = {"track": "car", "scans": scans, "skipped": skipped}
    assert [one.scan_number for one in detections_of(said, 0)] == [0, 2, 4]


def test_leaning_boxes_stand_upright_in_kitti(tmp_path):
    lean = torch.tensor((0.999, 0.03, 0.02, 0.02), dtype=torch.float64)
    qw, qx, qy, qz = (lean / lean.norm()).tolist()
    box = Box((10.0, 0.0, -1.0), (4.0, 1.8, 1.6), (qw, qx, qy, qz))
    one = Detection("car", 0, "0", 0, "car", "lidar", 1.0, box)
    (file,) = write_kitti_labels(tmp_path, [one], camera_at_the_lidar())
    (found,) = read_boxes(file)
    assert found.T_rect_object.translation.tolist() == pytest.approx((0, 1, 10), abs=1e-5)
    assert found.T_rect_object.rotation[1].tolist() == [0, 0, -1]


_BOX = '{"centre": [1, 2, 3], "size": [4, 2, 1], "quaternion_wxyz": [1, 0, 0, 0]}'


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"car-1"', "\udcff"),
        ('"car-1"', '"\\ud800"'),
        ('"track"', '"name"'),
        ('"car-1"', '"../car-1"'),
        ("[1, 2, 3]", "[1, 2]"),
        ("[4, 2, 1]", "[4, 2, 1e400]"),
        ("[1, 0, 0, 0]", "[0, 0, 0, 0]"),
        ('"lidar"', '"radar"'),
        ("0.5", "null"),
        ("0.5", "NaN"),
        (_BOX, "7"),
    ],
)
def test_damaged_results_are_named_before_a_box_is_written(old, new, tmp_path):
    text = f'{{"track": "car-1", "sensor": "lidar", "scans": [{{"scan": "7", "box": {_BOX},'
    text += ' "confidence": 0.5}]}'
    path = tmp_path / "car-1" / "objects.json"
    path.parent.mkdir()
    path.write_text(text)
    (whole,) = read_detections(tmp_path)
    assert (whole.track, whole.scan_number, whole.score) == ("car-1", 7, 0.5)
    assert whole.box.size == (4, 2, 1)
    path.write_bytes(text.replace(old, new).encode(errors="surrogateescape"))
    with pytest.raises(BadInputError, match=r"objects\.json: expected what complete"):
        read_detections(tmp_path)
