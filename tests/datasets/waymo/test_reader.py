# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Segments rendered here in Waymo's own parquet layout, with known objects."""

import shutil
import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from tests.cars import poses_of
from tests.datasets.write_nuscenes import off_surface
from tests.datasets.write_waymo import (
    PERIOD,
    SEGMENT,
    START,
    Thing,
    as_pose,
    mount,
    vehicle_pose,
    write_waymo,
)
from tests.refusal import refusal_of

from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.waymo.reader import Waymo, find_splits, frames
from wildshape.datasets.waymo.tables import COMPONENTS, range_images, read_boxes
from wildshape.errors import BadInputError, MissingExtraError
from wildshape.geometry.transforms.se3 import SE3

PARKED = Thing("Parked-car_0")
MOVING = Thing(
    "moving1", size=(6.2, 2.4, 2.9), start=(850.0, 1509.0, -49.6), step=(0.9, 0.5, 0), yaw=0.5,
    frames=(0, 2),
)  # fmt: skip
WALKER = Thing("walker2", 2, (0.8, 0.8, 1.8), (866.0, 1494.0, -50.0))
THINGS = (PARKED, MOVING, WALKER)


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    return write_waymo(tmp_path_factory.mktemp("waymo") / "training", THINGS)


@pytest.fixture
def own(split, tmp_path):
    """A copy, for tests that break it."""
    return shutil.copytree(split, tmp_path / "waymo" / "training")


def tables(split):
    return {name: split / name / f"{SEGMENT}.parquet" for name in COMPONENTS}


def test_parts_are_segments(own):
    (own / "lidar" / f"._{SEGMENT}.parquet").write_bytes(b"left by macOS")
    assert Waymo(own).parts() == Waymo(own.parent).parts() == [SEGMENT]


@pytest.mark.parametrize("table", [True, False])
def test_round_trip_to_the_objects_surface(split, tmp_path, table):
    """With a table of inclinations, and with evenly spread ones."""
    root = split if table else write_waymo(tmp_path / "training", THINGS, table=False)
    source = Waymo(root)
    found = {track.name: track for track in all_tracks(source)}
    assert set(found) == {f"{SEGMENT}_{thing.token}" for thing in (PARKED, MOVING)}
    assert source.rejected == {"object: category pedestrian": 1}
    for thing in (PARKED, MOVING):
        track = found[f"{SEGMENT}_{thing.token}"]
        assert track.scan_names == tuple(str(START + PERIOD * frame) for frame in thing.frames)
        T_object_sensor = poses_of(track).inverse()
        for i, frame in enumerate(thing.frames):
            local = T_object_sensor[i].apply_numpy(track.scans[i])
            assert off_surface(local, thing.size).max() < 1e-3
            # Where the sensor stood at the frame's time, found without the reader's transforms.
            rotation, place = as_pose(vehicle_pose(frame))
            turn, at = thing.pose(frame)
            expected = turn.inv().apply(rotation.apply(mount()[:3, 3]) + place - at)
            assert T_object_sensor[i].translation.numpy() == pytest.approx(expected, abs=1e-3)
    assert "box 4.70 x 2.00 x 1.70 m" in found[f"{SEGMENT}_{PARKED.token}"].source


def test_the_pose_of_each_pixel_matters(split):
    """With the frame's pose for all pixels the points would be off by decimetres."""
    first = next(iter(frames(tables(split), read_boxes(tables(split)["lidar_box"]))))
    right = first.points()
    numbers = vehicle_pose(0.0).astype(np.float32)
    wrong_poses = np.broadcast_to(numbers, first.pixel_poses.shape)
    wrong = type(first)(**{**vars(first), "pixel_poses": wrong_poses}).points()
    assert np.linalg.norm(right - wrong, axis=1).max() > 0.3


def test_rays_begin_where_the_sensor_was(split):
    """It goes 1.6 m during a turn; by the writer's own columns and poses."""
    first = next(iter(frames(tables(split), read_boxes(tables(split)["lidar_box"]))))
    full, seen = first.scan(rays=True), first.image[..., 0] > 0
    rotation, place = as_pose(vehicle_pose(0.0))
    matrix = mount()
    shares = np.arange(seen.shape[1]) / seen.shape[1] - 0.5
    turns, places = as_pose(vehicle_pose(shares))
    starts = turns.apply(matrix[:3, 3]) + places
    starts = (rotation.inv().apply(starts - place) - matrix[:3, 3]) @ matrix[:3, :3]
    assert full.origins is not None
    assert full.lost is not None
    columns = np.concatenate((np.nonzero(seen)[1], np.nonzero(~seen)[1]))
    assert np.abs(full.origins - starts[columns]).max() < 0.051
    assert np.ptp(full.origins, axis=0).max() > 1
    azimuth = np.pi - 2 * np.pi * (shares + 0.5 + 0.5 / seen.shape[1])
    azimuth -= np.arctan2(matrix[1, 0], matrix[0, 0])
    up = first.calibration.inclinations(len(seen))[::-1][np.nonzero(~seen)[0]]
    level, across = np.cos(up), azimuth[np.nonzero(~seen)[1]]
    rays = np.stack((level * np.cos(across), level * np.sin(across), np.sin(up)), axis=1)
    rays = (turns.as_matrix()[np.nonzero(~seen)[1]] @ (rays @ matrix[:3, :3].T)[:, :, None])[..., 0]
    rays = rotation.inv().apply(rays) @ matrix[:3, :3]
    assert full.lost == pytest.approx(rays, abs=1e-5)


def test_points_lie_on_their_rays_where_the_vehicle_stands(split):
    """A plain check of the geometry: the middle column looks along the vehicle's x axis."""
    first = next(iter(frames(tables(split), read_boxes(tables(split)["lidar_box"]))))
    image = np.zeros_like(first.image)
    image[7, 449:451, 0] = 10.0
    rotation, place = as_pose(vehicle_pose(0.0))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), place
    still = np.broadcast_to(vehicle_pose(0.0), first.pixel_poses.shape)
    changed = {"image": image, "pixel_poses": still, "T_world_vehicle": SE3.from_matrix(matrix)}
    points = type(first)(**{**vars(first), **changed}).points()
    up = first.calibration.inclinations(len(image))[::-1][7]
    azimuth = np.array((1, -1)) * np.pi / 900 - np.arctan2(mount()[1, 0], mount()[0, 0])
    expected = np.stack((np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth)), axis=1)
    assert points[:, :2] == pytest.approx(10 * expected, abs=1e-4)
    assert points[:, 2] == pytest.approx(10 * np.sin(up), abs=1e-4)


def test_motion_and_categories_select(split):
    def tokens(**how):
        tracks = all_tracks(Waymo(split, Selection(**how)))
        return {track.name.removeprefix(f"{SEGMENT}_") for track in tracks}

    assert tokens(motion="moving") == {MOVING.token}
    assert tokens(motion="parked") == {PARKED.token}
    assert tokens(min_scans=3) == {PARKED.token}
    assert tokens(categories=("pedestrian",), min_points=20) == {WALKER.token}
    with pytest.raises(BadInputError, match="'car' is no category of Waymo; there are vehicle"):
        tokens(categories=("car",))


def test_a_split_that_lacks_another_table_is_counted(own):
    other = "2601205676330128831"
    for component in ("lidar", "lidar_box"):
        (own.parent / "validation" / component).mkdir(parents=True)
        (own.parent / "validation" / component / f"{other}.parquet").touch()
    source = Waymo(own.parent)
    assert source.parts() == [SEGMENT, other]
    assert len(list(source.tracks_of(SEGMENT))) > 0
    missing = "validation: no lidar_calibration, lidar_pose, vehicle_pose beside lidar; download"
    with pytest.raises(BadInputError, match=missing):
        list(source.tracks_of(other))


def test_a_split_without_labels_is_passed_over(own):
    shutil.copytree(own / "lidar", own.parent / "testing" / "lidar")
    assert find_splits(own.parent) == [own]


refused = refusal_of(lambda root: list(all_tracks(Waymo(root))))


def test_a_wrong_root_says_what_was_expected_and_found(own, tmp_path):
    refused(tmp_path / "nowhere", r"nowhere: no such folder; expected <root>/<split>/\{lidar,")
    refused(own / "lidar", r"expected <root>/<split>/\{lidar,lidar_box.*found 1002394760")
    (tmp_path / "v1").mkdir()
    (tmp_path / "v1" / "segment-1.tfrecord").write_bytes(b"")
    refused(tmp_path / "v1", r"holds \.tfrecord files, Waymo's version 1; download version 2")
    with pytest.raises(BadInputError, match="no segment 123 in any split"):
        list(Waymo(own).tracks_of("123"))


@pytest.mark.parametrize("component", COMPONENTS[1:])
def test_missing_and_truncated_tables_are_named(own, component):
    path = own / component / f"{SEGMENT}.parquet"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    refused(own, rf"{component}.{SEGMENT}\.parquet: expected a parquet table, found a damaged")
    path.unlink()
    refused(own, rf"{component}.{SEGMENT}\.parquet: no such file; download this component")
    path.parent.rmdir()
    refused(own, rf"training: no {component} beside lidar; download")


def edit(split, component, change):
    path = split / component / f"{SEGMENT}.parquet"
    table = parquet.read_table(path)
    parquet.write_table(change(table), path)


def replaced(table, name, values):
    index = table.schema.get_field_index(name)
    return table.set_column(
        index, table.schema.field(name), pa.array(values, table.field(name).type)
    )


def test_tables_of_different_frames_are_named(own, split):
    edit(own, "vehicle_pose", lambda table: table.slice(1))
    refused(own, rf"lidar_box.{SEGMENT}\.parquet: frame {START} has no counterpart")
    shutil.copytree(split, own, dirs_exist_ok=True)
    edit(own, "lidar_pose", lambda table: table.slice(0, 2))
    refused(own, rf"lidar.{SEGMENT}\.parquet: frame {START + 2 * PERIOD} has no counterpart")
    shutil.copytree(split, own, dirs_exist_ok=True)
    edit(own, "lidar", lambda table: table.take([4, 1, 7]))
    refused(own, r"lidar.*frames are not in time order")


def test_values_that_do_not_fit_are_named(own, split):
    values = "[LiDARPoseComponent].range_image_return1.values"
    edit(own, "lidar_pose", lambda table: replaced(table, values, [[0.0] * 12] * 3))
    refused(own, r"a range image of shape \[40, 900, 6\] has 12 values")
    shutil.copytree(split, own, dirs_exist_ok=True)
    beams = "[LiDARCalibrationComponent].beam_inclination.values"
    edit(own, "lidar_calibration", lambda table: replaced(table, beams, [None, [0.1, 0.2]]))
    refused(own, r"lidar_calibration.*lists 2 beams of the TOP LiDAR, whose range image has 40")
    edit(own, "lidar_calibration", lambda table: table.slice(0, 1))
    refused(own, r"lidar_calibration.*no calibration of the TOP LiDAR")
    extrinsic = "[LiDARCalibrationComponent].extrinsic.transform"
    edit(own, "lidar_calibration", lambda table: table.drop_columns([extrinsic]))
    refused(own, r"lidar_calibration.*no column \[LiDARCalibrationComponent\]\.extrinsic")


def test_frames_without_an_image_are_counted(own):
    edit(own, "lidar", lambda table: table.slice(0, 6))
    source = Waymo(own)
    assert {len(track.scans) for track in all_tracks(source)} == {1, 2}
    assert source.rejected["scan: the frame has no range image of TOP"] == 2


def test_one_image_is_held_of_a_row_group_of_many(tmp_path):
    rng = np.random.default_rng(0)
    images = rng.random((40, 64 * 650 * 6), np.float32)  # 1 MB each
    column = "[LiDARPoseComponent].range_image_return1"
    table = pa.table(
        {
            "key.frame_timestamp_micros": np.arange(40),
            "key.laser_name": np.ones(40, np.int8),
            f"{column}.values": pa.array(list(images), pa.list_(pa.float32())),
            f"{column}.shape": pa.array([[64, 650, 6]] * 40, pa.list_(pa.int32(), 3)),
        }
    )
    path = tmp_path / "poses.parquet"
    parquet.write_table(table, path)
    del table
    assert parquet.ParquetFile(path).num_row_groups == 1
    before = pa.total_allocated_bytes()
    for i, (time, image) in enumerate(range_images(path, "LiDARPoseComponent")):
        assert time == i
        assert np.array_equal(image.ravel(), images[i])
        assert pa.total_allocated_bytes() - before < 10e6


def test_pyarrow_is_asked_for_by_name(split, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'wildshape\[arrow\]'"):
        list(all_tracks(Waymo(split)))
