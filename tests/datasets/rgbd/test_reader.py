# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Frames written here in the documented layout, of chairs whose every face is known."""

import json
import re
import shutil

import numpy as np
import pytest
from PIL import Image
from tests.datasets.damaged import passed_over
from tests.datasets.street import moved
from tests.datasets.unit_scene import off_boxes
from tests.datasets.write_rgbd import CAMERA, THINGS, write_png, write_sequence
from tests.refusal import refusal_of

from wildshape.datasets.rgbd.depth_image import supported
from wildshape.datasets.rgbd.reader import Cut, Rgbd, cut_out
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.records import Intrinsics


def tracks(root, **options):
    return {track.name: track for track in all_tracks(Rgbd(root, **options))}


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("inside", [False, True])
def test_points_land_back_on_the_chairs(tmp_path, apart, inside):
    """Masks together or apart; the root is the folder of sequences or the sequence itself."""
    T_camera_world = write_sequence(tmp_path / "kitchen", apart=apart)
    for images in ("depth", "masks"):
        (tmp_path / "kitchen" / images / "._000000.png").write_bytes(b"left by macOS")
    found = tracks(tmp_path / "kitchen" if inside else tmp_path)
    assert set(found) == {"kitchen_00001", "kitchen_00002"}
    for number, T_world_object in THINGS.items():
        track = found[f"kitchen_{number:05d}"]
        assert track.T_sensor_object is None
        assert track.scan_names == tuple(f"{i:06d}" for i in range(5))
        for i, scan in enumerate(track.scans):
            assert len(scan) > 200
            T_object_camera = np.linalg.inv(T_camera_world[i] @ T_world_object)
            assert off_boxes(moved(T_object_camera, scan.astype(np.float64))).max() < 1e-3


def test_what_a_track_says(tmp_path):
    write_sequence(tmp_path / "kitchen")
    first, second = tracks(tmp_path).values()
    assert (first.category, second.category) == ("chair", "stool")
    camera = first.sensor.intrinsics
    assert camera == Intrinsics(140.0, 143.0, 79.2, 61.7, 160, 120)
    assert first.source == "RGB-D kitchen"


@pytest.mark.parametrize(
    ("motion", "kept"), [("moving", "kitchen_00002"), ("parked", "kitchen_00001")]
)
def test_motion_is_known_by_the_cameras_poses(tmp_path, motion, kept):
    """The camera moves 2.5 m meanwhile, one chair 1.5 m."""
    write_sequence(tmp_path / "kitchen", moves=True)
    assert list(tracks(tmp_path, selection=Selection(motion=motion))) == [kept]
    (tmp_path / "kitchen" / "poses.txt").unlink()
    assert tracks(tmp_path, selection=Selection(motion=motion)) == {}


def test_pixels_between_two_surfaces_are_left_out():
    """A square before a wall, its border mixed with the wall as sensors mix it."""
    rng = np.random.default_rng(0)
    depth = np.full((60, 60), 3.0)
    depth[15:45, 15:45] = 1.0
    border = np.zeros((60, 60), bool)
    border[14:46, 14:46] = True
    border[16:44, 16:44] = False
    depth[border] = rng.uniform(1.05, 2.95, border.sum())
    mask = np.zeros((60, 60), bool)
    mask[14:46, 14:46] = True
    camera = Intrinsics(60.0, 60.0, 30.0, 30.0, 60, 60)
    rough = cut_out(depth, mask, camera, Cut(edge=0, jump=1e9))
    clean = cut_out(depth, mask, camera, Cut())
    assert (rough[:, 2] > 1.02).sum() > 200
    assert (clean[:, 2] > 1.02).sum() == 0
    assert len(clean) > 0.95 * 28 * 28


def test_corners_and_slopes_are_kept():
    slope = 1.0 + 0.01 * np.arange(20)[:, None] + np.zeros((1, 20))
    square = np.zeros((20, 20), bool)
    square[5:15, 5:15] = True
    assert (supported(slope, square, 0.02) == square).all()


def test_far_pixels_and_too_many_are_left_out(tmp_path):
    write_sequence(tmp_path / "kitchen", count=2)
    near = tracks(tmp_path, cut=Cut(max_depth=1.3))["kitchen_00001"]
    every = tracks(tmp_path)["kitchen_00001"]
    assert near.scans[0][:, 2].max() <= 1.3 < every.scans[0][:, 2].max()
    few = tracks(tmp_path, cut=Cut(most_points=150))["kitchen_00001"]
    assert [len(scan) for scan in few.scans] == [150, 150]
    assert set(map(tuple, few.scans[0])) <= set(map(tuple, every.scans[0]))


def test_long_sequences_and_gaps_make_several_tracks(tmp_path):
    write_sequence(tmp_path / "kitchen", count=7)
    cut = {name: track.scan_names for name, track in tracks(tmp_path, longest=3).items()}
    assert cut["kitchen_00001"] == ("000000", "000001", "000002")
    assert cut["kitchen_00001_1"] == ("000003", "000004", "000005")
    assert cut["kitchen_00001_2"] == ("000006",)
    for i in (2, 3, 4):
        (tmp_path / "kitchen" / "masks" / f"{i:06d}.png").unlink()
    source = Rgbd(tmp_path, gap=2)
    again = {track.name: track.scan_names for track in all_tracks(source)}
    assert again["kitchen_00002"] == ("000000", "000001")
    assert again["kitchen_00002_1"] == ("000005", "000006")
    assert source.rejected == {"frame: no mask": 3}
    assert len(tracks(tmp_path, gap=3)) == 2
    assert len(tracks(tmp_path, gap=0)) == 4


def test_masks_of_no_object_are_counted(tmp_path):
    """All of a sequence's masks were empty, and nothing said why no track came of it."""
    write_sequence(tmp_path / "kitchen", count=2)
    for file in (tmp_path / "kitchen" / "masks").glob("*.png"):
        write_png(file, np.zeros((CAMERA["height"], CAMERA["width"]), np.uint8))
    source = Rgbd(tmp_path)
    assert list(all_tracks(source)) == []
    assert source.rejected == {"mask: empty": 2}


def test_images_that_are_counted_without_leading_zeros_are_refused(tmp_path):
    """They were taken in the order 0, 1, 10, 11, 2, and so were the poses."""
    write_sequence(tmp_path / "kitchen", count=1)
    depth = tmp_path / "kitchen" / "depth"
    image = (depth / "000000.png").rename(depth / "0.png")
    for number in range(1, 12):
        shutil.copy(image, depth / f"{number}.png")
    refused(tmp_path, r"depth: 11\.png is sorted before 2\.png, .* with leading zeros\.$")


def test_selection(tmp_path):
    write_sequence(tmp_path / "kitchen", count=4)
    source = Rgbd(tmp_path, Selection(categories=("stool",), every=2))
    (track,) = all_tracks(source)
    assert (track.name, track.scan_names) == ("kitchen_00002", ("000000", "000002"))
    assert source.rejected == {"scan: category chair": 4}
    assert source.parts() == ["kitchen"]


refused = refusal_of(lambda root: list(all_tracks(Rgbd(root))))


def test_a_picture_of_depths_is_no_depth_image(tmp_path):
    """Its grey values were taken for millimetres: a chair of 6 cm, 12 cm away."""
    write_sequence(tmp_path / "kitchen", count=2)
    for image in (tmp_path / "kitchen" / "depth").glob("*.png"):
        write_png(image, np.full((120, 160), 200, np.uint8))
    refused(tmp_path, r"000000\.png: holds 8 bits a pixel, expected a 16-bit depth PNG")


@pytest.mark.parametrize(
    "change", [{"depth_scale": 10}, {"depth_scale": 1000, "fx": 0.9, "fy": 0.9}]
)
def test_objects_as_large_as_a_town_are_left_out(tmp_path, change):
    """A wrong depth_scale (the images have 10,000 a metre); focal lengths in image widths."""
    write_sequence(tmp_path / "kitchen", count=2)
    (tmp_path / "kitchen" / "camera.json").write_text(json.dumps(CAMERA | change))
    source = Rgbd(tmp_path)
    assert list(all_tracks(source)) == []
    assert source.rejected["scan: over 100 m across: check the unit"] == 4


def test_a_camera_of_images_of_another_size_is_doubted(tmp_path):
    write_sequence(tmp_path / "kitchen", count=1)
    source = Rgbd(tmp_path)
    assert list(all_tracks(source))
    assert source.doubts == ()
    twice = {name: 2 * CAMERA[name] for name in ("fx", "fy", "cx", "cy")} | {"depth_scale": 1000}
    (tmp_path / "kitchen" / "camera.json").write_text(json.dumps(CAMERA | twice))
    assert list(all_tracks(source))
    (doubt,) = source.doubts
    assert re.search(r"camera\.json: cx 157\.4, cy 122\.4 .* 160 x 120 pixels", doubt)


def test_the_largest_number_of_a_depth_image_is_no_depth(tmp_path):
    """Cameras write it for nothing seen; taken for a depth it is 6.5 m away, a hole in a chair."""
    write_sequence(tmp_path / "kitchen", count=1)
    file = tmp_path / "kitchen" / "depth" / "000000.png"
    masks = tmp_path / "kitchen" / "masks" / "000000.png"
    with Image.open(file) as image, Image.open(masks) as ids:
        depth, seen = np.array(image).astype(np.uint16), np.array(ids) == 1
    rows = np.flatnonzero(seen.any(1))
    depth[rows[len(rows) // 2] - 4 : rows[len(rows) // 2] + 4] = 0xFFFF
    write_png(file, depth)
    assert all(track.scans[0][:, 2].max() < 3.0 for track in tracks(tmp_path).values())


@pytest.mark.parametrize("lens", [{"distortion": [0.1, -0.2, 0, 0, 0]}, {"k1": 0.1, "k2": 0}])
def test_a_lens_that_bends_lines_is_refused(tmp_path, lens):
    """Points are made as of a pinhole camera; coefficients of 0 say that this is right."""
    write_sequence(tmp_path / "kitchen", count=1)
    file = tmp_path / "kitchen" / "camera.json"
    camera = json.loads(file.read_text())
    none = {name: [0.0] * 5 if isinstance(value, list) else 0.0 for name, value in lens.items()}
    file.write_text(json.dumps(camera | none))
    assert len(tracks(tmp_path)) == 2
    file.write_text(json.dumps(camera | lens))
    refused(tmp_path, r"camera\.json: (distortion|k1) is not 0, .* undistort depth and masks")


def test_two_folders_of_one_instance_are_refused(tmp_path):
    """3 and 03: one of the two objects was lost without a word."""
    write_sequence(tmp_path / "kitchen", apart=True)
    masks = tmp_path / "kitchen" / "masks"
    (masks / "2").rename(masks / "01")
    refused(tmp_path, "masks/1: 01 beside it is of the same instance")


def test_an_image_of_all_instances_beside_folders_of_single_ones_is_refused(tmp_path):
    """The folders were passed over, and their objects lost."""
    write_sequence(tmp_path / "kitchen", apart=True)
    masks = tmp_path / "kitchen" / "masks"
    (masks / "000001.png").write_bytes(next(masks.glob("1/*.png")).read_bytes())
    refused(tmp_path, r"masks/000001\.png: an image of all instances beside folders .* such as 1;")


def test_a_damaged_first_image_loses_its_frame_alone(tmp_path):
    write_sequence(tmp_path / "kitchen", count=3)
    (tmp_path / "kitchen" / "depth" / "000000.png").write_bytes(b"\x89PNG")
    for track in passed_over(Rgbd(tmp_path), r"depth/000000\.png: "):
        assert track.scan_names == ("000001", "000002")


def test_missing_and_damaged_files_are_named(tmp_path):
    folder = tmp_path / "kitchen"
    refused(
        tmp_path,
        "expected folders with camera.json, .* in them, found an empty folder",
    )
    write_sequence(folder, count=2)
    camera, mask = folder / "camera.json", folder / "masks" / "000001.png"
    good = camera.read_text(), mask.read_bytes()
    camera.unlink()
    refused(tmp_path, r"camera\.json: no such file")
    camera.write_text("{")
    refused(tmp_path, r"camera\.json: expected JSON with fx")
    camera.write_text(json.dumps({"fx": 1, "fy": 1}))
    refused(tmp_path, r"camera\.json: lacks cx, cy")
    camera.write_text(json.dumps(CAMERA))
    refused(tmp_path, r"camera\.json: lacks depth_scale; .* units in a metre")
    camera.write_text(json.dumps(CAMERA | {"depth_scale": 0}))
    refused(tmp_path, r"camera\.json: depth_scale is 0, expected a number above 0")
    camera.write_text(json.dumps(CAMERA | {"depth_scale": 0.001}))
    refused(tmp_path, r"camera\.json: depth_scale is 0\.001, .* metres in a unit, write 1000\.$")
    camera.write_text(json.dumps(CAMERA | {"depth_scale": 1000, "width": 320}))
    refused(tmp_path, r"160 x 120 pixels, expected 320 x 120")
    camera.write_text(good[0])
    write_png(mask, np.zeros((24, 32), np.uint8))
    passed_over(Rgbd(tmp_path), r"000001\.png: 32 x 24 pixels, expected 160 x 120")
    Image.new("RGB", (160, 120)).save(mask)
    passed_over(Rgbd(tmp_path), r"000001\.png: expected a PNG mask of one channel, found colours")
    mask.write_bytes(good[1][:60])
    passed_over(Rgbd(tmp_path), r"000001\.png: ")
    mask.write_bytes(good[1])
    poses = folder / "poses.txt"
    poses.write_text(poses.read_text().splitlines()[0] + "\n")
    refused(tmp_path, r"poses\.txt")
    poses.unlink()
    (folder / "objects.json").write_text('{"cup": "cup"}')
    refused(tmp_path, "'cup' is no instance number")
    (folder / "objects.json").unlink()
    (folder / "depth" / "000000.png").rename(folder / "depth" / "000009.png")
    assert len(tracks(tmp_path)) == 2  # a frame without its mask is counted
    (folder / "masks").rename(folder / "labels")
    refused(tmp_path, "masks: no such folder")
