# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Renders written here in DPC's layout, of a chair whose every face is known."""

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat
from tests.cars import poses_of, shape_of
from tests.datasets.unit_scene import off_boxes
from tests.datasets.write_shapenet_views import SYNSET, write_data, write_list, write_model
from tests.refusal import refusal_of

from wildshape.datasets.shapenet.reader import ShapeNetViews
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.errors import BadInputError


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = tmp_path_factory.mktemp("dpc") / "data"
    return root, write_data(root)


@pytest.mark.parametrize("pixels", [128, 224])
@pytest.mark.parametrize("with_K", [True, False])
def test_points_land_back_on_the_chair(tmp_path, pixels, with_K):
    """Within 1 mm of a chair of unit size: half a pixel would be 4 mm."""
    expected = write_data(tmp_path, pixels=pixels, with_K=with_K)
    tracks = list(all_tracks(ShapeNetViews(tmp_path)))
    assert [track.name for track in tracks] == [f"{SYNSET}_{model}" for model in expected]
    for track, T_camera_world in zip(tracks, expected.values(), strict=True):
        poses = poses_of(track)
        assert len(track.scans) == 5
        for i, scan in enumerate(track.scans):
            assert len(scan) > 800
            assert np.asarray(poses[i]) == pytest.approx(T_camera_world[i], abs=1e-9)
            assert off_boxes(poses[i].inverse().apply_numpy(scan)).max() < 1e-3


def test_the_true_shape_is_in_the_same_frame(written):
    for track in all_tracks(ShapeNetViews(written[0])):
        assert off_boxes(shape_of(track).astype(np.float64)).max() < 1e-6


def test_depth_is_read_without_pushing_the_surface_away(written):
    """The renderer cuts depth off: at most a step of 0.15 mm too near, never farther."""
    track = next(all_tracks(ShapeNetViews(written[0])))
    pose = poses_of(track)[0]
    gap = off_boxes(pose.inverse().apply_numpy(track.scans[0]))
    assert gap.max() < 10 / 65535 + 1e-6


def test_what_a_track_says(written):
    track = next(all_tracks(ShapeNetViews(written[0])))
    assert (track.category, track.source) == ("chair", "ShapeNet views train")
    assert track.scan_names == tuple(f"depth_{i}" for i in range(5))
    camera = track.sensor.intrinsics
    assert track.sensor.kind == "camera"
    assert camera is not None
    assert (camera.fx, camera.fy, camera.cx, camera.width) == (240.0, 240.0, 64.0, 128)


def test_larger_renders_give_as_many_points_as_128_pixels(tmp_path):
    poses = write_data(tmp_path / "small")
    write_data(tmp_path / "large", pixels=224)
    few, many, all_of_it = (
        [len(scan) for scan in next(all_tracks(ShapeNetViews(root, pixels=pixels))).scans]
        for root, pixels in ((tmp_path / "small", 128), (tmp_path / "large", 128),
                             (tmp_path / "large", 0))
    )  # fmt: skip
    assert len(poses) == 3
    assert many == pytest.approx(few, rel=0.03)
    assert all_of_it == pytest.approx(np.multiply(few, (224 / 128) ** 2), rel=0.03)


@pytest.mark.parametrize("split", ["train", "val", "test"])
def test_splits_by_their_lists(written, split):
    source = ShapeNetViews(written[0], split=split)
    (part,) = source.parts()
    (track,) = source.tracks_of(part)
    assert part == f"{SYNSET}_{split}_000000-000000"
    assert track.source.endswith(split)


def test_parts_are_some_models_each(written, tmp_path):
    assert len(ShapeNetViews(written[0]).parts()) == 3
    root = tmp_path / "data"
    write_data(root)
    write_list(root, "train", [f"m{i}" for i in range(70)])
    source = ShapeNetViews(root, split="train")
    assert [part[-13:] for part in source.parts()] == [
        "000000-000031", "000032-000063", "000064-000069",
    ]  # fmt: skip
    assert list(source.tracks_of(source.parts()[2])) == []
    assert source.rejected == {"object: no depth views": 6}


def test_views_are_chosen_and_counted(written):
    root, _ = written
    few = next(all_tracks(ShapeNetViews(root, Selection(every=2), views=4)))
    assert few.scan_names == ("depth_0", "depth_2")
    source = ShapeNetViews(root, Selection(min_points=100_000), split="train")
    assert list(all_tracks(source)) == []
    assert source.rejected == {
        "scan: fewer than 100000 points on the object": 5,
        "object: fewer than 1 scans left": 1,
    }


refused = refusal_of(lambda root, **options: list(all_tracks(ShapeNetViews(root, **options))))


def test_wrong_folders_and_categories_are_named(written, tmp_path):
    root, _ = written
    refused(root / "renders", "expected DPC's data folder.*found 03001627")
    refused(tmp_path / "no", "in it, no such folder")
    refused(root, "'boat' is no category", selection=Selection(categories=("boat",)))
    refused(root, "holds none of 02958343", selection=Selection(categories=("car",)))
    with pytest.raises(BadInputError, match="part 'x'"):
        list(ShapeNetViews(root).tracks_of("x"))


def test_missing_and_damaged_files_are_named(tmp_path):
    root = tmp_path / "data"
    write_model(root, "a1", views=1)
    refused(root, r"03001627_train\.txt: no such file; copy the folder")
    write_list(root, "train", ["a1"])
    folder = root / "renders" / SYNSET / "a1"
    depth, camera = folder / "depth_0.png", folder / "camera_0.mat"
    good = depth.read_bytes(), camera.read_bytes()

    def one(match):
        refused(root, match, split="train")

    camera.unlink()
    one(r"camera_0\.mat: no such file")
    camera.write_bytes(good[1][:150])
    one(r"camera_0\.mat: expected a MATLAB file")
    savemat(camera, {"pos": np.zeros(3)})
    one(r"camera_0\.mat: lacks 'extrinsic'")
    savemat(camera, {"extrinsic": np.diag((1.0, 1.0, -1.0, 1.0))})
    one(r"camera_0\.mat: extrinsic: a pose is no rotation")
    for K in (np.zeros((3, 3)), np.diag([60.0, -60.0, 1.0]), np.diag([60.0, 1e-71, 1.0])):
        K[0, 2] = 12.0
        savemat(camera, {"extrinsic": np.eye(4), "K": K})
        one(r"camera_0\.mat: K is no camera matrix")
    camera.write_bytes(good[1])
    depth.write_bytes(good[0][: len(good[0]) // 2])
    one(r"depth_0\.png: cannot be read as a 16-bit depth PNG")
    Image.new("RGB", (8, 8)).save(depth)
    one(r"depth_0\.png: expected a 16-bit depth PNG, found colours")
    write_list(root, "train", ["../../etc"])
    one("expected a model a line")
