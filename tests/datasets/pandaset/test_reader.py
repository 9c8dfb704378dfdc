# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scene written here in PandaSet's own layout, with known cars."""

import json

import numpy as np
import pytest
import torch
from tests.cars import off_surface, poses_of
from tests.datasets.damaged import passed_over
from tests.datasets.street import SIZE, moved, street
from tests.datasets.write_pandas import Made, Name, pickled, write_frame
from tests.datasets.write_pandaset import (
    AGO,
    SIBLING,
    STAMPS,
    T_EGO_BASE,
    UUIDS,
    text,
    write_poses,
    write_scene,
    write_sweep,
)
from tests.refusal import refusal_of

from wildshape.datasets.pandaset.reader import PandaSet
from wildshape.datasets.pandaset.scene import Drive, read_sweep
from wildshape.datasets.tracks.selection import Selection
from wildshape.geometry.transforms.se3 import SE3

FRAMES = 3
MOUNTED_AT = (0.0002, 0.8078, 1.8460)  # on the base: right, forward, up


@pytest.fixture(scope="module")
def made():
    return street(FRAMES)


@pytest.fixture
def scene(made, tmp_path):
    return write_scene(tmp_path / "pandaset" / "011", made)


def tracks(root, **options):
    source = PandaSet(root, **options)
    return [track for part in source.parts() for track in source.tracks_of(part)]


def test_points_land_back_on_the_cars(scene):
    found = {track.name: track for track in tracks(scene)}
    assert set(found) == {f"011_{uuid}" for uuid in UUIDS.values()}
    for track in found.values():
        assert track.scan_names == ("00", "01", "02")
        assert (track.category, track.sensor.kind) == ("car", "lidar")
        assert track.label_size_m == pytest.approx(SIZE)
        for i, scan in enumerate(track.scans):
            assert len(scan) > 100
            assert off_surface(poses_of(track)[i].inverse().apply_numpy(scan)).max() < 1e-3


def test_the_sensor_stands_on_the_roof_when_its_beams_pass(scene, made):
    """The origin, by hand: on the base at the time of the car's own points; x ahead, z up."""
    places = [(T @ T_EGO_BASE) for T in made.T_world_ego]
    sensor = [moved(T, np.array([MOUNTED_AT]))[0] for T in places]
    found = {track.name: track for track in tracks(scene)}
    for name, uuid in UUIDS.items():
        poses = poses_of(found[f"011_{uuid}"])
        for i in range(FRAMES):
            T_world_sensor = made.T_world_object[name][i] @ np.linalg.inv(np.asarray(poses[i]))
            j = max(i, 1)
            share = (STAMPS[i] - AGO[name] - STAMPS[j - 1]) / (STAMPS[j] - STAMPS[j - 1])
            expected = sensor[j - 1] + share * (sensor[j] - sensor[j - 1])
            # Turning on the way takes the roof 1 mm off the straight line.
            assert T_world_sensor[:3, 3] == pytest.approx(expected, abs=2e-3)
            ahead, up = made.T_world_ego[i][:3, 0], made.T_world_ego[i][:3, 2]
            assert T_world_sensor[:3, 0] @ ahead > np.cos(0.06)
            assert T_world_sensor[:3, 2] @ up > np.cos(0.03)


def test_the_first_sweep_goes_as_the_second_and_a_single_one_stands():
    """At a pose of the base, the sensor is where it is mounted; on the way from one, beside it."""
    places = torch.tensor(((0.0, 0, 0), (0, 1, 0), (0, 5, 0)), dtype=torch.float64)
    T_world_base = SE3(torch.eye(3).double().expand(3, 3, 3), places)
    drive = Drive([0.0, 0.1, 0.2], T_world_base)
    for frame, time, forward in ((0, -0.05, -0.5), (0, 0.0, 0.0), (1, 0.05, 0.5), (2, 0.15, 3.0)):
        place = drive.sensor_pose(frame, time).translation.numpy()
        assert place == pytest.approx(np.add(MOUNTED_AT, (0, forward, 0)))
    alone = Drive([0.0], T_world_base[1:2]).sensor_pose(0, -0.05).translation.numpy()
    assert alone == pytest.approx(np.add(MOUNTED_AT, (0, 1, 0)))


def test_of_two_labels_the_pandargts_is_left_out(scene):
    source = PandaSet(scene)
    assert all(SIBLING not in track.name for track in source.tracks_of("011"))
    assert source.rejected == {"object: the PandarGT's label of an object that has two": 1}


def test_parked_and_moving_by_their_place_in_the_world(scene):
    for motion in ("parked", "moving"):
        (track,) = tracks(scene, selection=Selection(motion=motion))
        assert track.name == f"011_{UUIDS[motion]}"


@pytest.mark.parametrize("level", range(3))
def test_root_may_be_a_scene_or_up_to_two_folders_above(scene, level):
    assert len(tracks((scene, *scene.parents)[level])) == 2


def test_what_is_left_out_is_counted(made, tmp_path):
    scene = write_scene(tmp_path / "011", made, "Pedestrian")
    assert tracks(scene) == []
    (scene / "lidar" / "01.pkl.gz").unlink()
    source = PandaSet(scene, Selection(categories=("Pedestrian",), min_points=10**6))
    assert list(source.tracks_of("011")) == []
    assert source.rejected == {
        "scan: the frame has no LiDAR file": 2,
        "scan: fewer than 1000000 points on the object": 4,
        "object: fewer than 1 scans left": 2,
        "object: the PandarGT's label of an object that has two": 1,
    }


def test_points_without_a_place_or_a_time_are_left_out(tmp_path):
    points = np.arange(12.0).reshape(4, 3)
    points[1, 2], times = np.nan, np.array([0.0, 0.1, np.inf, 0.3])
    write_sweep(tmp_path / "00.pkl.gz", points, times, np.zeros(4))
    found, when = read_sweep(tmp_path / "00.pkl.gz")
    assert (found.tolist(), when.tolist()) == (points[[0, 3]].tolist(), [0.0, 0.3])


refused = refusal_of(tracks)


def test_a_wrong_root_says_what_was_expected_and_found(tmp_path):
    refused(tmp_path / "nowhere", "nowhere: no such folder; give a scene of PandaSet")
    refused(tmp_path, r"expected PandaSet's <scene>/annotations/cuboids.* found an empty folder")
    (tmp_path / "velodyne").mkdir()
    refused(tmp_path, r"found velodyne\.$")


def test_missing_and_corrupt_files_are_named(scene, made, tmp_path):
    sweep = scene / "lidar" / "01.pkl.gz"
    good = sweep.read_bytes()
    sweep.write_bytes(good[: len(good) // 2])
    passed_over(PandaSet(scene), r"01\.pkl\.gz: expected a gzipped pickle")
    write_frame(sweep, {"x": np.zeros(3)})
    passed_over(PandaSet(scene), r"01\.pkl\.gz: no column y among x")
    write_sweep(sweep, np.zeros((1, 3)), np.zeros(1), np.zeros(1))
    poses = scene / "lidar" / "poses.json"
    whole = poses.read_text()
    poses.write_text(whole[:-30])
    refused(scene, r"poses\.json: expected a JSON list")
    poses.write_text(json.dumps(json.loads(whole)[:2]))
    refused(scene, r"2 poses and 3 timestamps in lidar/ for 3 labelled frames")
    stamps = scene / "lidar" / "timestamps.json"
    stamps.write_text(json.dumps(STAMPS[:2]))
    labels = scene / "annotations" / "cuboids"
    (labels / "01.pkl.gz").rename(tmp_path / "01.pkl.gz")
    refused(scene, r"2 poses and 2 timestamps in lidar/ for 3 labelled frames")
    (tmp_path / "01.pkl.gz").rename(labels / "01.pkl.gz")
    poses.write_text(whole.replace('"w": ', '"w": 1', 1))
    stamps.write_text(json.dumps(STAMPS[:3]))
    refused(scene, r"poses\.json: a heading is no unit quaternion")
    poses.write_text(whole)
    for times in (STAMPS[2::-1], [*STAMPS[:2], float("inf")]):
        stamps.write_text(json.dumps(times))
        refused(scene, r"timestamps\.json: the times do not rise")
    poses.write_text(whole.replace('"w"', '"v"', 1))
    refused(scene, r"poses\.json: expected poses and timestamps")
    poses.unlink()
    refused(scene, r"poses\.json: no such file")
    write_poses(scene, made)
    label = scene / "annotations" / "cuboids" / "02.pkl.gz"
    write_frame(label, {"uuid": text(["a"])})
    refused(scene, r"02\.pkl\.gz: no column label among uuid")


def test_files_that_are_no_frames_are_passed_over(scene):
    expected = [track.scan_names for track in tracks(scene)]
    labels = scene / "annotations" / "cuboids"
    for name in ("._00.pkl.gz", "00_backup.pkl.gz", "²2.pkl.gz"):
        (labels / name).write_bytes(b"left by somebody")
    assert [track.scan_names for track in tracks(scene)] == expected
    for number in range(FRAMES):
        (labels / f"{number:02d}.pkl.gz").unlink()
    refused(scene, r"cuboids: holds none of 00\.pkl\.gz to 79\.pkl\.gz; get the scene's archive")


def test_a_malicious_label_is_refused(scene, tmp_path):
    import gzip

    command = Made(Name("os", "system"), (f"touch {tmp_path / 'trace'}",))
    label = scene / "annotations" / "cuboids" / "00.pkl.gz"
    label.write_bytes(gzip.compress(pickled(command)))
    refused(scene, r"00\.pkl\.gz: this pickle wants to use os\.system")
    assert not (tmp_path / "trace").exists()
