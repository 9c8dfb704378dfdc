# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`complete --boxes`: every format lies there, holds every scan, and says in which frame it is."""

import json
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.datasets.street import street
from tests.datasets.write_argoverse2 import T_EGO_UP, pose_columns, write_log, write_table
from tests.datasets.write_kitti_tracking import EYE, write_sequence

from wildshape.datasets.argoverse2.log import read_boxes as read_argoverse2
from wildshape.datasets.argoverse2.log import read_sensor_pose
from wildshape.datasets.kitti.tracking_labels import read_boxes as read_kitti
from wildshape.errors import BadInputError
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.io.boxes.detections import Detection, pose_of
from wildshape.records import Box

FORMATS = ("json", "kitti", "nuscenes", "argoverse2")


@pytest.fixture(scope="module")
def tracks(dataset, tmp_path_factory):
    """Two tracks of the data set, so that it is fast."""
    path = tmp_path_factory.mktemp("two") / "cars"
    for track in sorted(path for path in dataset.iterdir() if path.is_dir())[:2]:
        shutil.copytree(track, path / track.name)
    return path


@pytest.fixture(scope="module")
def calibrations(tmp_path_factory):
    root = tmp_path_factory.mktemp("calibrations")
    scene = street(1, points=200, eye=EYE)
    write_log(root / "log", scene)
    return {
        "kitti": write_sequence(root / "training", scene) / "calib" / "0001.txt",
        "argoverse2": root / "log" / "calibration" / "egovehicle_SE3_sensor.feather",
    }


def boxes_in(out):
    rows = json.loads((out / "boxes" / "boxes.json").read_text())["boxes"]
    return {
        (row["track"], row["scan"]): Box(
            *(tuple(row[name]) for name in ("centre", "size", "quaternion_wxyz"))
        )
        for row in rows
    }


def test_all_formats_hold_the_boxes_of_all_scans(tracks, trained, wildshape, tmp_path):
    out = tmp_path / "done"
    found = wildshape("complete", tracks, "--out", out, "--model", trained, "--boxes", *FORMATS)
    assert found.code == 0, found.err
    assert "camera at the LiDAR's own place" in found.err
    boxes = boxes_in(out)
    assert len(boxes) == 12
    for path in out.glob("*/objects.json"):
        track = json.loads(path.read_text())
        for scan in track["scans"]:
            assert boxes[track["track"], scan["scan"]].centre == tuple(scan["box"]["centre"])
        labels = read_kitti(out / "boxes" / "kitti" / f"{track['track']}.txt")
        assert [label.frame for label in labels] == [int(s["scan"]) for s in track["scans"]]
        x, y, z = labels[0].T_rect_object.translation.tolist()
        assert (z, -x, -y) == pytest.approx(track["scans"][0]["box"]["centre"], abs=1e-4)
    results = json.loads((out / "boxes" / "nuscenes.json").read_text())["results"]
    assert sum(map(len, results.values())) == 12
    assert len(read_argoverse2(out / "boxes" / "argoverse2").timestamps) == 12
    # The same once more is refused; replaced, nothing of before stays.
    again = ("complete", tracks, "--out", out, "--model", trained)
    assert wildshape(*again).code == 2
    assert wildshape(*again, "--overwrite").code == 0
    assert not (out / "boxes").exists()


@pytest.mark.parametrize("kind", ["kitti", "argoverse2"])
def test_a_calibration_takes_boxes_to_the_formats_own_frame(
    kind, calibrations, tracks, trained, wildshape, tmp_path
):
    out = tmp_path / "done"
    chosen = ("--boxes", "json", kind, "--calibration", calibrations[kind])
    found = wildshape("complete", tracks, "--out", out, "--model", trained, *chosen)
    assert found.code == 0, found.err
    assert "--calibration" not in found.err
    (track, scan), box = next(iter(boxes_in(out).items()))
    pose = np.asarray(pose_of(box))
    if kind == "argoverse2":
        there = np.asarray(read_argoverse2(out / "boxes" / "argoverse2").T_ego_object[0])
        assert there[:3, :3] == pytest.approx(T_EGO_UP[:3, :3] @ pose[:3, :3], abs=1e-5)
        return
    label = next(b for b in read_kitti(out / f"boxes/kitti/{track}.txt") if b.frame == int(scan))
    rows = {}
    for line in calibrations["kitti"].read_text().splitlines():
        name, numbers = line.split(":")
        rows[name] = np.fromstring(numbers, sep=" ")
    velo = rows["Tr_velo_to_cam"].reshape(3, 4)
    expected = rows["R0_rect"].reshape(3, 3) @ (velo[:, :3] @ pose[:3, 3] + velo[:, 3])
    assert label.T_rect_object.translation.tolist() == pytest.approx(expected.tolist(), abs=1e-4)


def test_argoverse2s_calibration_is_the_file_that_is_named(calibrations, tmp_path):
    log = calibrations["argoverse2"].parents[1]
    copy = shutil.copy(calibrations["argoverse2"], tmp_path / "calibration.feather")
    named, plain = (BoxFiles(("argoverse2",), file) for file in (copy, None))
    box = Box((9.0, 1.0, 0.0), (4.0, 2.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    one = Detection("car", 0, "7", 7, "car", "lidar", 0.5, box)
    named.check()
    for files, out in ((named, tmp_path / "named"), (plain, tmp_path / "plain")):
        files.write_detections(out, [one])
    ego, sensor = (
        read_argoverse2(tmp_path / out / "boxes" / "argoverse2").T_ego_object[0]
        for out in ("named", "plain")
    )
    expected = (read_sensor_pose(log, "both") @ sensor).matrix
    np.testing.assert_allclose(ego.matrix, expected, atol=1e-6)
    # Of one LiDAR there is no such frame, and no other file is read in its place.
    beside = tmp_path / "log" / "calibration"
    shutil.copytree(log / "calibration", beside)
    write_table(beside / "up.feather", {"sensor_name": ["up_lidar"]} | pose_columns([T_EGO_UP]))
    with pytest.raises(BadInputError, match=r"up\.feather: no sensor down_lidar"):
        BoxFiles(("argoverse2",), beside / "up.feather").check()


def test_a_calibration_that_nothing_takes_is_refused_before_work(
    calibrations, tracks, trained, refused, tmp_path
):
    begin = ("complete", tracks, "--out", tmp_path / "out", "--model", trained)
    file = calibrations["kitti"]
    assert "name that format" in refused(*begin, "--calibration", file)
    assert "name that format" in refused(
        *begin, "--boxes", "kitti", "--calibration", calibrations["argoverse2"]
    )
    assert "no such file" in refused(
        *begin, "--boxes", "kitti", "--calibration", tmp_path / "none.txt"
    )
    broken = shutil.copy(file, tmp_path / "broken.txt")
    broken.write_text(file.read_text().replace("Tr_velo_to_cam", "Tr_other"))
    assert "Tr_velo_to_cam" in refused(*begin, "--boxes", "kitti", "--calibration", broken)
    assert "stdout holds one shape" in refused(
        "complete", tracks, "--out", "-", "--model", trained, "--boxes", "json"
    )
    assert not (tmp_path / "out").exists()


def test_boxes_of_cameras_have_the_axes_of_lidars_where_a_format_has_these(tmp_path):
    """2 m ahead, 0.5 m to the right and 0.1 m up: a camera's z, x and -y."""
    pose = Rotation.from_matrix([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # its x ahead, its z up
    x, y, z, w = pose.as_quat().tolist()
    box = Box((0.5, -0.1, 2.0), (1.0, 2.0, 3.0), (w, x, y, z))
    one = Detection("c", 0, "7", 7, "chair", "camera", 0.5, box)
    files = BoxFiles(("nuscenes", "argoverse2", "kitti"))
    (told,) = files.write_detections(tmp_path, [one])
    assert "depth cameras" in told
    results = json.loads((tmp_path / "boxes" / "nuscenes.json").read_text())["results"]
    ((said,),) = results.values()
    assert said["translation"] == pytest.approx([2.0, -0.5, 0.1])
    assert np.abs(said["rotation"]) == pytest.approx([1, 0, 0, 0], abs=1e-6)
    there = read_argoverse2(tmp_path / "boxes" / "argoverse2").T_ego_object[0].translation
    assert there.tolist() == pytest.approx([2.0, -0.5, 0.1])
