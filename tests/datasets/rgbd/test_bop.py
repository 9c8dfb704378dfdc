# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scene written here in the BOP format, of chairs whose every face is known."""

import json

import numpy as np
import pytest
from PIL import Image
from tests.cars import poses_of, shape_of
from tests.datasets.damaged import passed_over
from tests.datasets.street import rigid
from tests.datasets.unit_scene import off_boxes
from tests.datasets.write_rgbd import THINGS, pose_fields, write_bop, write_model, write_png
from tests.refusal import refusal_of

from wildshape.datasets.rgbd.bop import Bop
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks

NAMES = ("test_000001_obj000007", "test_000001_obj000007-1")


def tracks(root, **options):
    return {track.name: track for track in all_tracks(Bop(root, **options))}


@pytest.mark.parametrize("scale", [0.1, 1.0])
def test_points_land_back_on_the_chairs(tmp_path, scale):
    T_camera_world = write_bop(tmp_path, scale=scale)
    found = tracks(tmp_path)
    assert tuple(found) == NAMES
    for name, T_world_object in zip(NAMES, THINGS.values(), strict=True):
        track, poses = found[name], poses_of(found[name])
        assert track.category == "obj_000007"
        assert track.shape is None
        for i, scan in enumerate(track.scans):
            assert len(scan) > 200
            assert np.asarray(poses[i]) == pytest.approx(T_camera_world[i] @ T_world_object)
            assert off_boxes(poses[i].inverse().apply_numpy(scan)).max() < 1e-3


def test_shapes_come_from_the_models(tmp_path):
    write_bop(tmp_path, count=1)
    write_model(tmp_path)
    for track in tracks(tmp_path).values():
        assert shape_of(track).shape == (8192, 3)
        assert off_boxes(shape_of(track).astype(np.float64)).max() < 1e-5
    assert all(track.shape is None for track in tracks(tmp_path, shapes=False).values())


@pytest.mark.parametrize("below", ["", "test", "test/000001"])
def test_root_may_be_the_data_set_a_split_or_a_scene(tmp_path, below):
    write_bop(tmp_path, count=1)
    assert len(tracks(tmp_path / below)) == 2


def test_motion_is_known_where_the_cameras_stand_in_a_world(tmp_path):
    write_bop(tmp_path / "a", world=True)
    write_bop(tmp_path / "b")
    assert len(tracks(tmp_path / "a", selection=Selection(motion="parked"))) == 2
    assert tracks(tmp_path / "b", selection=Selection(motion="parked")) == {}


def test_what_stands_far_from_the_worlds_origin_stands(tmp_path):
    """Near the origin a camera's pose that is not inverted moves the objects too little."""
    T_camera_world = write_bop(tmp_path)
    file = tmp_path / "test" / "000001" / "scene_camera.json"
    cameras = json.loads(file.read_text())
    for i, T in enumerate(T_camera_world):
        cameras[str(i)] |= pose_fields(T @ rigid(30.0, 0.0, 0.0, yaw=0.0), "w2c")
    file.write_text(json.dumps(cameras))
    assert tuple(tracks(tmp_path, selection=Selection(motion="parked"))) == NAMES


def test_of_different_objects_each_has_its_own_mask(tmp_path):
    """A mask is counted in the image's whole list, not among the same objects."""
    write_bop(tmp_path, count=1)
    file = tmp_path / "test" / "000001" / "scene_gt.json"
    truth = json.loads(file.read_text())
    truth["0"][0]["obj_id"] = 3
    file.write_text(json.dumps(truth))
    found = tracks(tmp_path)
    assert tuple(found) == ("test_000001_obj000003", "test_000001_obj000007")
    for track in found.values():
        on_object = poses_of(track)[0].inverse().apply_numpy(track.scans[0])
        assert off_boxes(on_object).max() < 1e-3


def test_images_are_taken_in_the_order_of_their_numbers(tmp_path):
    """Of texts "10" is the second, whatever order the file has."""
    write_bop(tmp_path, count=11)
    file = tmp_path / "test" / "000001" / "scene_gt.json"
    file.write_text(json.dumps(json.loads(file.read_text()), sort_keys=True))
    for track in tracks(tmp_path).values():
        assert track.scan_names == tuple(f"{i:06d}" for i in range(11))


def test_the_largest_number_of_a_depth_image_is_no_depth(tmp_path):
    write_bop(tmp_path, count=1)
    scene = tmp_path / "test" / "000001"
    with Image.open(scene / "depth" / "000000.png") as image:
        depth = np.array(image).astype(np.uint16)
    with Image.open(scene / "mask_visib" / "000000_000000.png") as image:
        rows = np.flatnonzero(np.array(image).any(1))
    depth[rows[len(rows) // 2] - 4 : rows[len(rows) // 2] + 4] = 0xFFFF
    write_png(scene / "depth" / "000000.png", depth)
    assert all(track.scans[0][:, 2].max() < 3.0 for track in tracks(tmp_path).values())


def test_selection_and_counts(tmp_path):
    write_bop(tmp_path)
    source = Bop(tmp_path, Selection(categories=("obj_000008",)))
    assert list(all_tracks(source)) == []
    assert source.rejected == {"scan: category obj_000007": 8}
    assert source.parts() == ["test/000001"]
    assert [len(t.scans) for t in tracks(tmp_path, selection=Selection(every=2)).values()] == [2, 2]


def test_long_scenes_and_gaps_make_several_tracks_of_different_names(tmp_path):
    write_bop(tmp_path, count=8)
    found = {name: track.scan_names for name, track in tracks(tmp_path, longest=4).items()}
    assert [len(found[f"{NAMES[0]}{again}"]) for again in ("", "_1")] == [4, 4]
    truth = tmp_path / "test" / "000001" / "scene_gt.json"
    seen = json.loads(truth.read_text())
    truth.write_text(json.dumps(seen | {f"{i}": [] for i in range(1, 5)}))
    found = [(track.name, track.scan_names) for track in all_tracks(Bop(tmp_path, longest=3))]
    assert sorted(found) == [
        (NAMES[0], ("000000",)),
        (NAMES[1], ("000000",)),
        (f"{NAMES[1]}_1", ("000005", "000006", "000007")),
        (f"{NAMES[0]}_1", ("000005", "000006", "000007")),
    ]
    assert len(tracks(tmp_path, longest=5)) == 2


refused = refusal_of(lambda root: list(all_tracks(Bop(root))))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"obj_id": 7.5}, r"obj_id 7\.5 is no whole number"),
        ({"obj_id": "7"}, r"obj_id '7' is no whole number"),
        ({"cam_t_m2c": [0.0, -1e30, 1e3]}, r"a pose is 1e\+30 mm away"),
        ({"cam_t_m2c": [0.0, float("nan"), 1e3]}, r"a pose is nan mm away"),
    ],
)
def test_numbers_that_none_writes_are_refused(tmp_path, wrong, told):
    write_bop(tmp_path, count=2)
    file = tmp_path / "test" / "000001" / "scene_gt.json"
    truth = json.loads(file.read_text())
    truth["1"][0] |= wrong
    file.write_text(json.dumps(truth))
    refused(tmp_path, f"BOP's fields of image 1.*{told}")


def test_missing_and_damaged_files_are_named(tmp_path):
    refused(tmp_path, r"expected a BOP data set, split or scene .* found an empty folder")
    write_bop(tmp_path, count=2)
    scene = tmp_path / "test" / "000001"
    camera, truth = scene / "scene_camera.json", scene / "scene_gt.json"
    good = camera.read_text(), truth.read_text()
    camera.write_text(json.dumps({"0": json.loads(good[0])["0"]}))
    refused(tmp_path, r"scene_camera\.json: lacks image 1")
    camera.write_text(json.dumps({"0": {}, "1": {}}))
    refused(tmp_path, "expected BOP's fields of image 0")
    camera.write_text("[]")
    refused(tmp_path, r"scene_camera\.json: expected JSON with cam_K")
    camera.unlink()
    refused(tmp_path, r"scene_camera\.json: no such file")
    camera.write_text(good[0])
    entries = json.loads(good[1])
    entries["1"][0]["cam_R_m2c"] = [2.0] * 9
    truth.write_text(json.dumps(entries))
    refused(tmp_path, r"000001.*a pose is")
    truth.write_text("{}")
    refused(tmp_path, r"scene_gt\.json: holds no image")
    truth.write_text(good[1])
    mask = scene / "mask_visib" / "000001_000001.png"
    write_png(mask, np.zeros((24, 32), np.uint8))
    passed_over(Bop(tmp_path), r"000001_000001\.png: \(24, 32\) pixels, .* has \(120, 160\)")
    mask.unlink()
    passed_over(Bop(tmp_path), r"000001_000001\.png: no such file; the split's archive")
    (scene / "depth" / "000000.png").write_bytes(b"\x89PNG")
    (track,) = passed_over(Bop(tmp_path), r"depth/000000\.png: ")
    assert track.scan_names == ("000001",)
    (scene / "depth" / "000001.png").unlink()
    refused(tmp_path, r"depth/000000\.png: ")
    (scene / "depth" / "000000.png").rename(scene / "depth" / "000000.tif")
    refused(tmp_path, r"depth/000000\.tif: .* write it as 000000\.png")
