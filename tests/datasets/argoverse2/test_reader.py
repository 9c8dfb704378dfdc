# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A log written here in Argoverse 2's own layout, with known cars."""

import sys

import numpy as np
import pytest
from scipy.spatial import KDTree
from tests.cars import off_surface, poses_of
from tests.datasets.damaged import passed_over
from tests.datasets.street import moved, street
from tests.datasets.write_argoverse2 import (
    LOG,
    STAMPS,
    T_EGO_DOWN,
    T_EGO_UP,
    UUIDS,
    in_ego,
    offsets_ns,
    write_calibration,
    write_log,
    write_sweep,
    write_table,
)
from tests.refusal import refusal_of

from wildshape.datasets.argoverse2.reader import Argoverse2
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import MissingExtraError

FRAMES = 3


def representable(scene):
    """Only the points that float16 leaves on the cars: it rounds to 8 mm at 10 m."""
    for i, cloud in enumerate(scene.clouds):
        kept = []
        rounded = moved(scene.T_world_ego[i], in_ego(scene.T_world_ego[i], cloud).astype(float))
        for places in scene.T_world_object.values():
            off = off_surface(moved(np.linalg.inv(places[i]), rounded))
            kept.append(cloud[off < 5e-4])
        scene.clouds[i] = np.concatenate(kept)
    return scene


@pytest.fixture(scope="module")
def scene():
    return representable(street(FRAMES, points=20000))


@pytest.fixture
def log(scene, tmp_path):
    return write_log(tmp_path / "argoverse2" / "sensor" / "val" / LOG, scene)


def tracks(root, **options):
    source = Argoverse2(root, **options)
    return [track for part in source.parts() for track in source.tracks_of(part)]


def test_points_land_back_on_the_cars(log, scene):
    found = {track.name: track for track in tracks(log)}
    assert set(found) == {f"{LOG}_{uuid}" for uuid in UUIDS.values()}
    for track in found.values():
        assert track.scan_names == tuple(str(stamp) for stamp in STAMPS[:FRAMES])
        assert (track.category, track.sensor.kind) == ("regular_vehicle", "lidar")
        for i, scan in enumerate(track.scans):
            assert len(scan) > 100
            assert off_surface(poses_of(track)[i].inverse().apply_numpy(scan)).max() < 1e-3


@pytest.mark.parametrize("lidar", ["up", "down", "both"])
def test_truth_is_in_the_frame_of_the_lidar(log, scene, lidar):
    """By plain matrices: axes of up_lidar, origin at the LiDAR or between the two."""
    T_ego_sensor = T_EGO_UP.copy()
    share = {"up": 0, "down": 1, "both": 0.5}[lidar]
    T_ego_sensor[:3, 3] += share * (T_EGO_DOWN - T_EGO_UP)[:3, 3]
    found = {track.name: track for track in tracks(log, lidar=lidar)}
    for name, uuid in UUIDS.items():
        poses = poses_of(found[f"{LOG}_{uuid}"])
        for i in range(FRAMES):
            T_world_sensor = scene.T_world_ego[i] @ T_ego_sensor
            expected = np.linalg.inv(T_world_sensor) @ scene.T_world_object[name][i]
            assert np.asarray(poses[i]) == pytest.approx(expected, abs=1e-6)


def test_each_lidar_took_its_own_points(log):
    both, up, down = (tracks(log, lidar=lidar)[0] for lidar in ("both", "up", "down"))
    counts = [len(track.scans[0]) for track in (both, up, down)]
    assert counts[0] == counts[1] + counts[2]
    assert min(counts[1:]) > 100


@pytest.mark.parametrize("lidar", ["up", "down", "both"])
def test_rays_begin_where_their_lidar_was(log, scene, lidar):
    """The vehicle goes 20 m/s: 2 m while a LiDAR turns once."""
    T_ego_sensor = T_EGO_UP.copy()
    T_ego_sensor[:3, 3] += {"up": 0, "down": 1, "both": 0.5}[lidar] * (T_EGO_DOWN - T_EGO_UP)[:3, 3]
    T_sensor_ego = np.linalg.inv(T_ego_sensor)
    for track in tracks(log, lidar=lidar, rays=True):
        for i in range(FRAMES - 1):
            cloud = moved(T_sensor_ego, in_ego(scene.T_world_ego[i], scene.clouds[i]).astype(float))
            rays = track.rays[i]
            assert rays is not None
            away, found = KDTree(cloud).query(rays.ends)
            assert np.max(away) < 1e-4
            rows = np.asarray(found)
            share = (offsets_ns(len(cloud))[rows] / 1e8)[:, None]
            ways = []
            for T_world_ego in scene.T_world_ego[i : i + 2]:
                T = T_sensor_ego @ np.linalg.inv(scene.T_world_ego[i]) @ T_world_ego
                up, down = ((T @ T_ego_lidar)[:3, 3] for T_ego_lidar in (T_EGO_UP, T_EGO_DOWN))
                ways.append(np.where(rows[:, None] % 2 == 0, up, down))
            expected = (1 - share) * ways[0] + share * ways[1]
            assert np.abs(rays.starts - expected).max() < 0.11  # a step of 10 ms
            assert np.ptp(rays.starts[:, 0]) > 0.5
    # The last sweep's motion is not known: no pose comes after it.


def test_parked_and_moving_by_their_place_in_the_city(log):
    for motion in ("parked", "moving"):
        (track,) = tracks(log, selection=Selection(motion=motion))
        assert track.name == f"{LOG}_{UUIDS[motion]}"


@pytest.mark.parametrize("level", range(4))
def test_root_may_be_a_log_or_up_to_three_folders_above(log, level):
    assert len(tracks((log, *log.parents)[level])) == 2


def test_what_is_left_out_is_counted(scene, tmp_path):
    log = write_log(tmp_path / "a", scene, "PEDESTRIAN")
    source = Argoverse2(log)
    assert list(source.tracks_of(*source.parts())) == []
    assert source.rejected == {"object: category PEDESTRIAN": 2}
    (log / f"sensors/lidar/{STAMPS[1]}.feather").unlink()
    source = Argoverse2(log, Selection(categories=("PEDESTRIAN",), min_points=10**6))
    assert list(source.tracks_of("a")) == []
    assert source.rejected == {
        "scan: the frame has no LiDAR file": 2,
        "scan: fewer than 1000000 points on the object": 4,
        "object: fewer than 1 scans left": 2,
    }


refused = refusal_of(tracks)


def test_a_wrong_root_says_what_was_expected_and_found(tmp_path):
    refused(tmp_path / "nowhere", "nowhere: no such folder; give a log of Argoverse 2")
    refused(tmp_path, r"expected <split>/<log>/annotations\.feather .* found an empty folder")
    (tmp_path / "velodyne").mkdir()
    refused(tmp_path, r"found velodyne\.$")


def test_missing_and_corrupt_files_are_named(log, scene):
    labels = log / "annotations.feather"
    good = labels.read_bytes()
    labels.write_bytes(good[: len(good) // 2])
    refused(log, r"annotations\.feather: expected a feather table")
    write_table(labels, {"timestamp_ns": [1]})
    refused(log, r"annotations\.feather: no column track_uuid among timestamp_ns")
    labels.write_bytes(good)
    sweep = log / f"sensors/lidar/{STAMPS[1]}.feather"
    sweep.write_bytes(sweep.read_bytes()[:500])
    assert (
        len(passed_over(Argoverse2(log), rf"{STAMPS[1]}\.feather: expected a feather table")) == 2
    )
    write_sweep(sweep, in_ego(scene.T_world_ego[1], scene.clouds[1]))
    write_calibration(log, ("ring_front_center", "up_lidar"))
    refused(log, r"egovehicle_SE3_sensor\.feather: no sensor down_lidar")
    (log / "calibration" / "egovehicle_SE3_sensor.feather").unlink()
    refused(log, r"egovehicle_SE3_sensor\.feather: no such file; the archive of Argoverse 2")


def test_poses_of_another_log_are_refused(log):
    columns = {"timestamp_ns": [1], "qw": [1.0], "qx": [0.0], "qy": [0.0], "qz": [0.0]}
    columns |= {"tx_m": [0.0], "ty_m": [0.0], "tz_m": [0.0]}
    write_table(log / "city_SE3_egovehicle.feather", columns)
    refused(log, f"has no pose for the labelled sweep {STAMPS[0]}")
    for broken in ({"qw": [0.0]}, {"tx_m": [1e300]}):
        write_table(log / "city_SE3_egovehicle.feather", columns | broken)
        refused(log, r"city_SE3_egovehicle\.feather: row 0 holds no pose")


def test_without_pyarrow_the_extra_is_named(log, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"wildshape\[arrow\]"):
        tracks(log)
