# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of other detectors: a line of each format by hand, and files that are none."""

import json
import math

import pytest
from tests.refusal import refused

from wildshape.io.boxes.detections import pose_of
from wildshape.io.boxes.kitti import camera_at_the_lidar
from wildshape.io.boxes.read_detector import fingerprint, read_detector_boxes

CAMERA = camera_at_the_lidar().T_rect_sensor
LABEL = "Car 0 0 0 0 0 0 0 1.6 1.8 4.0 -2.0 1.8 10.0 {turn}"
# 10 m ahead and 2 m to the left, 1 m under the sensor, looking to the left.
CENTRE, SIZE, FORWARD = (10.0, 2.0, -1.0), (4.0, 1.8, 1.6), (0.0, 1.0, 0.0)
LEFT = [10, 2, -1, 4.0, 1.8, 1.6, math.pi / 2]


def read(path, scans=1):
    return read_detector_boxes(path, CAMERA, scans)


def written(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def nuscenes(kind="detection", **other):
    half = math.sqrt(0.5)
    row = {"translation": CENTRE, "size": [1.8, 4.0, 1.6], "rotation": [half, 0, 0, half]}
    return {"results": {"000003": [{**row, f"{kind}_name": "car", f"{kind}_score": 0.5, **other}]}}


FILES = {
    "tracking.txt": (f"3 0 {LABEL.format(turn=-math.pi)} 0.5\n", "3", "0000"),
    "without_tracks.txt": (f"3 -1 {LABEL.format(turn=math.pi)}\n", "3", None),
    "000003.txt": (f"{LABEL.format(turn=-math.pi)} 0.5\n\n", "000003", None),
    "nuscenes.json": (nuscenes(), "000003", None),
    "tracks.json": (nuscenes("tracking", tracking_id=12), "000003", "12"),
    "any_length.json": (nuscenes(rotation=[3, 0, 0, 3]), "000003", None),
    "openpcdet.json": (
        [{"frame_id": "000003", "name": ["Car"], "score": [0.5], "boxes_lidar": [LEFT]}],
        "000003",
        None,
    ),
    "by_place.json": ([{"name": ["Car"], "boxes_lidar": [[*LEFT, 1.0, 0.5]]}], 0, None),
    "000004.json": (
        {"bboxes_3d": [[10, 2, -1.8, *LEFT[3:]]], "scores_3d": [0.5], "labels_3d": ["car"]},
        "000004",
        None,
    ),
    "boxes.csv": (
        "frame,time,track,x,y,z,length,width,height,yaw,confidence,points,moving\n"
        "3,,a,10,2,-1,4,1.8,1.6,1.5707963,0.5,100,0\n",
        3,
        "a",
    ),
}


@pytest.mark.parametrize("mark", ["", "\ufeff"], ids=["", "byte_order_mark"])
@pytest.mark.parametrize("name", FILES)
def test_every_format_says_the_same_box(name, mark, tmp_path):
    content, scan, track = FILES[name]
    path = written(tmp_path / name, content)
    path.write_text(mark + path.read_text(), "utf-8")
    (found,) = read(path)
    assert (found.scan, found.track) == (scan, track)
    assert found.category.lower() in ("car", "")
    assert found.score == (None if name in ("without_tracks.txt", "by_place.json") else 0.5)
    assert found.box.centre == pytest.approx(CENTRE, abs=1e-6)
    assert found.box.size == pytest.approx(SIZE)
    axes = pose_of(found.box).rotation.numpy()
    assert axes[:, 0] == pytest.approx(FORWARD, abs=1e-6)
    assert axes[:, 2] == pytest.approx((0, 0, 1), abs=1e-6)


def test_halves_of_characters_are_spelt_out_as_in_names_of_tracks(tmp_path):
    said = nuscenes(detection_name="car \ud83d", tracking_id="\ud83d")
    (one,) = read(written(tmp_path / "half.json", said))
    assert (one.category, one.track) == (r"car \ud83d", r"\ud83d")


def test_a_folder_is_read_file_by_file(tmp_path):
    for name in ("000005.TXT", "000004.txt"):
        written(tmp_path / name, f"{LABEL.format(turn=0)}\nDontCare {'-1 ' * 14}\n")
    written(tmp_path / "README", "no boxes")
    written(tmp_path / "._000004.txt", "left by macOS")
    assert [one.scan for one in read(tmp_path)] == ["000004", "000005"]


def test_files_of_several_drives_are_refused_and_those_of_several_tracks_are_not(tmp_path):
    line = LABEL.format(turn=0)
    for track in (1, 2):
        written(tmp_path / f"{track:04d}.txt", f"0 {track} {line}\n1 {track} {line}\n")
    assert [one.scan for one in read(tmp_path)] == ["0", "1", "0", "1"]
    written(tmp_path / "0002.txt", f"1 1 {line}\n2 1 {line}\n2 2 {line}\n")
    refused(read, tmp_path, match="0001.txt and 0002.txt both hold boxes of scan 1, .* alone")
    written(tmp_path / "0002.txt", f"2 1 {line}\n2 2 {line}\n")  # a file a scan
    assert len(read(tmp_path)) == 4


def test_a_list_that_names_no_scans_has_one_for_each(tmp_path):
    one = {"name": ["Car"], "boxes_lidar": [LEFT]}
    path = written(tmp_path / "results.json", [one, one])
    assert [box.scan for box in read(path, 2)] == [0, 1]
    refused(read, path, 3, match="a list of 2 scans, and the drive has 3; name each")
    named = [{**one, "frame_id": name} for name in ("000004", "000005")]
    assert len(read(written(path, named), 3)) == 2


def test_a_list_that_holds_a_scan_twice_is_refused(tmp_path):
    """Each of its vehicles was found twice."""
    one = {"frame_id": "000003", "name": ["Car"], "boxes_lidar": [LEFT]}
    path = written(tmp_path / "result.json", [one, {**one, "frame_id": "000004"}])
    assert len(read(path)) == 2
    refused(read, written(path, [one, one]), match=r"holds scan '000003' 2 times")


@pytest.mark.parametrize("degrees", ["90.0", "-90.0"])
@pytest.mark.parametrize("name", ["tracking.txt", "openpcdet.json", "000004.json", "boxes.csv"])
def test_turns_in_degrees_are_refused(name, degrees, tmp_path):
    """Their boxes stood across the vehicles, and cut out of each what lay in them."""
    content = FILES[name][0]
    text = content if isinstance(content, str) else json.dumps(content)
    for radians in (-math.pi, LEFT[-1], 1.5707963):
        text = text.replace(f"{radians}", degrees)
    path = written(tmp_path / name, text)
    refused(read, path, match=f"{name}.*a box turned by {float(degrees):g}, expected radians")


def test_a_fingerprint_tells_names_and_contents(tmp_path):
    path = written(tmp_path / "000001.txt", LABEL.format(turn=0))
    one = fingerprint(tmp_path)
    assert fingerprint(tmp_path) == one
    written(path, LABEL.format(turn=1))
    other = fingerprint(tmp_path)
    path.rename(tmp_path / "000002.txt")
    assert len({one, other, fingerprint(tmp_path)}) == 3


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.txt", "Car 1 2 3", "line 1 has 4 fields"),
        ("a.txt", LABEL.format(turn="left"), "labels of KITTI"),
        ("a.txt", LABEL.format(turn="nan"), "not finite"),
        ("a.txt", f"one 2 {LABEL.format(turn=0)}", "labels of KITTI"),
        ("a.txt", LABEL.format(turn=0).replace("1.8 4.0", "-1.8 4.0"), "a box of size"),
        ("a.txt", LABEL.format(turn=0).replace("1.8 4.0", "0 4.0"), "a box of size"),
        ("a.json", "{", "results of nuScenes"),
        ("a.json", {"boxes": []}, "results"),
        ("a.json", [1], "results of nuScenes"),
        ("a.json", 7, "results of nuScenes"),
        ("a.json", nuscenes(size=[1, 2]), "results of nuScenes"),
        ("a.json", nuscenes(rotation=[math.nan, 0, 0, 0]), "not finite"),
        ("a.txt", f"{LABEL.format(turn=0)} nan", "score is not finite"),
        ("a.json", nuscenes(detection_score=math.nan), "score is not finite"),
        ("a.json", nuscenes(rotation=[0, 0, 0, 0]), "next to 0"),
        ("a.json", nuscenes(rotation=[0.05, 0, 0, 0.05]), "next to 0"),
        ("a.json", [{"boxes_lidar": [LEFT], "pred_labels": [1]}], "no 'name'"),
        ("a.json", [{"boxes_lidar": [LEFT], "name": []}], "results of nuScenes"),
        ("a.json", [{"boxes_lidar": [LEFT[:6]], "name": ["Car"]}], "results of nuScenes"),
        ("a.json", {"bboxes_3d": [LEFT], "labels_3d": [2]}, "no 'name'"),
        (
            "a.json",
            {"bboxes_3d": [LEFT], "name": ["car"], "box_type_3d": "Camera"},
            "box_type_3d 'Camera'",
        ),
        ("a.csv", "x,y\n", "expected the header"),
        ("a.pkl", "anything", "a pickle runs code .* as JSON"),
        ("a.xml", "<a/>", "no format of boxes"),
    ],
)
def test_what_is_no_file_of_boxes_is_refused(name, content, match, tmp_path):
    refused(read, written(tmp_path / name, content), match=match)


def test_nothing_there_is_refused(tmp_path):
    refused(read, tmp_path / "absent.json", match="no such file or folder")
    refused(fingerprint, tmp_path / "absent.json", match="no such file or folder")
    refused(read, tmp_path, match="holds no .txt and no .json")
