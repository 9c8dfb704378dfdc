# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scenes written here in nuScenes' own layout, with known objects."""

import json
import math
import os
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.cars import poses_of
from tests.datasets.damaged import passed_over
from tests.datasets.write_nuscenes import (
    RELATIVES,
    Scene,
    Thing,
    ego_pose,
    off_surface,
    sensor_pose,
    token,
    write_nuscenes,
    write_relative,
)
from tests.refusal import refusal_of

from wildshape.datasets.nuscenes import table_index as nuscenes_index
from wildshape.datasets.nuscenes.reader import NuScenes
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.drives.recordings.nuscenes import open_scene
from wildshape.errors import BadInputError

CAR = Thing("car", velocity=(5.0, 3.0, 0.1), yaw_rate=0.3)
BUS = Thing(
    "bus", "vehicle.bus.rigid", (11.0, 2.9, 3.4), start=(395.0, 1195.0, 1.8), yaw=-2.0,
    keys=(0, 1, 3),
)  # fmt: skip
WALKER = Thing("walker", "human.pedestrian.adult", (0.7, 0.7, 1.8), start=(404.0, 1171.0, 1.0))
BICYCLE = Thing("bicycle", "vehicle.bicycle", (1.8, 0.6, 1.4), start=(420.0, 1170.0, 1.0))
FIRST = Scene("scene-0061", (CAR, BUS, WALKER, BICYCLE))
SECOND = Scene("scene-0103", (Thing("car", start=(390.0, 1170.0, 1.0), keys=(0, 1)),), keys=2)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_nuscenes(tmp_path_factory.mktemp("nuscenes"), (SECOND, FIRST))


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def own(tmp_path):
    """A data set of its own, for tests that break it."""
    return write_nuscenes(tmp_path / "nuscenes", (SECOND,))


def tracks(source, part="scene-0061"):
    return {track.category: track for track in source.tracks_of(part)}


def name_of(thing, scene=FIRST):
    return f"{scene.name}_{token(scene.name, thing.name)[:12]}"


def test_parts_are_scenes(written, cache):
    source = NuScenes(written, cache=cache)
    assert source.parts() == ["scene-0061", "scene-0103"]
    assert NuScenes(written / "v1.0-mini", cache=cache).parts() == source.parts()
    assert [len(track.scans) for track in source.tracks_of("scene-0103")] == [2]


def test_scans_are_found_where_one_stands_in_the_tables(own, tmp_path, monkeypatch):
    monkeypatch.chdir(own / "v1.0-mini")
    source = NuScenes(Path(), cache=tmp_path / "cache")
    assert source.parts() == ["scene-0103"]
    assert [len(track.scans) for track in source.tracks_of("scene-0103")] == [2]


def test_key_frames_round_trip_to_the_objects_surface(written, cache):
    source = NuScenes(written, cache=cache)
    found = tracks(source)
    assert {c: t.name for c, t in found.items()} == {"car": name_of(CAR), "bus.rigid": name_of(BUS)}
    for thing, track in ((CAR, found["car"]), (BUS, found["bus.rigid"])):
        assert len(track.scans) == len(thing.keys)
        T_object_sensor = poses_of(track).inverse()
        for i, scan in enumerate(track.scans):
            local = T_object_sensor[i].apply_numpy(scan)
            assert len(scan) == 400
            assert off_surface(local, thing.size).max() < 1e-3
            # Where the sensor stood, found without the reader's own transforms.
            t = 0.5 * thing.keys[i]
            at_global = ego_pose(t)[0].apply(sensor_pose("LIDAR_TOP")[1]) + ego_pose(t)[1]
            rotation, place = thing.pose(t)
            expected = rotation.inv().apply(at_global - place)
            assert T_object_sensor[i].translation.numpy() == pytest.approx(expected, abs=1e-6)
    assert source.rejected == {
        "object: category human.pedestrian.adult": 1,
        "object: category vehicle.bicycle": 1,
    }
    assert "box 4.60 x 1.90 x 1.60 m" in found["car"].source
    assert "interpolated" not in found["car"].source


def test_scans_are_rows_of_the_users_file(written, cache):
    track = tracks(NuScenes(written, cache=cache))["car"]
    for name, scan in zip(track.scan_names, track.scans, strict=True):
        raw = np.fromfile(written / "samples/LIDAR_TOP" / f"{name}.pcd.bin", "<f4").reshape(-1, 5)
        assert {row.tobytes() for row in scan} <= {row.tobytes() for row in raw[:, :3].copy()}


def test_sweeps_are_interpolated_between_neighbouring_key_frames_only(written, cache):
    found = tracks(NuScenes(written, sweeps=True, cache=cache))
    car, bus = found["car"], found["bus.rigid"]
    assert (len(car.scans), len(bus.scans)) == (16, 7)  # 3 gaps x 4 + 4; 1 gap x 4 + 3
    for thing, track in ((CAR, car), (BUS, bus)):
        assert "interpolated between key frames" in track.source
        T_object_sensor = poses_of(track).inverse()
        for i, scan in enumerate(track.scans):
            local = T_object_sensor[i].apply_numpy(scan)
            assert off_surface(local, thing.size).max() < 1e-3
    assert list(car.scan_names) == sorted(car.scan_names)


def test_motion_and_categories_select(written, cache):
    def categories(**how):
        return set(tracks(NuScenes(written, Selection(**how), cache=cache)))

    assert categories(motion="moving") == {"car"}
    assert categories(motion="parked") == {"bus.rigid"}
    assert categories(categories=("vehicle.bus",)) == {"bus.rigid"}
    assert categories(categories=("bicycle", "pedestrian")) == {"bicycle", "human.pedestrian.adult"}
    assert categories(categories=("car",), every=2, min_scans=3) == set()


def test_the_index_is_built_once_by_many_at_a_time(own, tmp_path, monkeypatch):
    built = []
    build = nuscenes_index._build
    monkeypatch.setattr(nuscenes_index, "_build", lambda *all: (built.append(1), build(*all)))
    cache, counts = tmp_path / "cache", []

    def convert():
        source = NuScenes(own, cache=cache)
        counts.append(len(list(source.tracks_of("scene-0103"))))

    threads = [threading.Thread(target=convert) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counts == [1] * 4
    assert len(built) == 1
    # Other tables, another index.
    table = own / "v1.0-mini" / "sample_annotation.json"
    table.write_text("[]")
    assert list(NuScenes(own, cache=cache).tracks_of("scene-0103")) == []
    assert len(built) == 2


def test_a_build_that_failed_leaves_no_index(own, tmp_path):
    table = own / "v1.0-mini" / "sample_annotation.json"
    whole, stamp = table.read_text(), table.stat()
    table.write_text(whole[:-2] + " " * 2)
    os.utime(table, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    refused(own, cache=tmp_path, match=r"sample_annotation\.json: expected a list")
    table.write_text(whole)
    # Same size and time as the broken one had: only a complete index may be believed.
    os.utime(table, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    assert len(list(NuScenes(own, cache=tmp_path).tracks_of("scene-0103"))) == 1


def test_blobs_that_are_not_here_are_counted(own, tmp_path):
    for file in (own / "samples" / "LIDAR_TOP").iterdir():
        file.unlink()
    source = NuScenes(own, cache=tmp_path)
    assert list(source.tracks_of("scene-0103")) == []
    assert source.rejected == {"scene: none of its LIDAR_TOP files is here": 1}


refused = refusal_of(lambda root, **options: list(all_tracks(NuScenes(root, **options))))


def edit(root, table, key, value, row=0):
    path = root / "v1.0-mini" / f"{table}.json"
    rows = json.loads(path.read_text())
    rows[row].pop(key) if value is None else rows[row].update({key: value})
    path.write_text(json.dumps(rows))


def test_a_wrong_root_says_what_was_expected_and_found(own, tmp_path):
    refused(
        tmp_path / "nowhere",
        cache=tmp_path,
        match=r"nowhere: no such folder; expected <root>/v1\.0-",
    )
    refused(
        own / "samples", cache=tmp_path, match=r"expected <root>/v1\.0-trainval.*found LIDAR_TOP"
    )
    write_nuscenes(own, (SECOND,), version="v1.0-trainval")
    refused(own, cache=tmp_path, match=r"holds v1\.0-mini and v1\.0-trainval.*give one of them")
    shutil.rmtree(own / "v1.0-trainval")
    (own / "v1.0-mini" / "sample_annotation.json").write_text("[]")
    refused(
        own, cache=tmp_path, match=r"sample_annotation\.json: no labels \(v1\.0-test has none\)"
    )
    (own / "samples").rename(own / "elsewhere")
    refused(
        own / "v1.0-mini",
        cache=tmp_path,
        match=r"expected samples/LIDAR_TOP beside v1\.0-mini, found",
    )


@pytest.mark.parametrize(
    ("table", "key", "value", "match"),
    [
        (
            "sample_annotation",
            "instance_token",
            "x",
            r"names the instance 'x', which instance\.json",
        ),
        ("sample_annotation", "sample_token", "x", r"names the sample 'x'"),
        ("sample_data", "ego_pose_token", "x", r"names the ego_pose 'x'"),
        ("instance", "category_token", "x", r"names the category 'x'"),
        ("sample", "scene_token", "x", r"names the scene 'x'"),
        ("sample", "scene_token", ["x"], r"scene_token is \['x'\] in a row"),
        ("sample_annotation", "instance_token", {}, r"instance_token is {} in a row"),
        ("category", "name", 7, r"name is 7 in a row"),
        ("sample_data", "filename", "a" * 300, r"filename is aaa"),
        ("sample_data", "filename", "/a", r"filename is /a"),
        ("sample_data", "filename", "a/../../b", r"filename is a/"),
        ("sample_annotation", "rotation", None, r"a row has no 'rotation'"),
        ("sample_annotation", "size", [1.0], r"expected 10 numbers in a row"),
        ("sample_annotation", "translation", ["a", "b", "c"], r"expected 10 numbers in a row"),
        ("sample_data", "timestamp", 1 << 63, ""),
        ("sample_data", "timestamp", float("inf"), ""),
        ("sample_data", "filename", "../../scan.pcd.bin", ""),
        ("ego_pose", "translation", [10**400, 0, 0], ""),
        ("ego_pose", "rotation", [0, 0, 0, 0], ""),
        ("ego_pose", "rotation", [float("nan"), 0, 0, 1], ""),
        ("sample_annotation", "size", [float("inf"), 1, 1], ""),
        ("sample_annotation", "size", [0, 1, 1], ""),
        ("instance", "token", ["a"], ""),
        ("scene", "name", {"a": 1}, ""),
        ("scene", "token", 5, ""),
    ],
)
def test_tables_that_do_not_fit_are_named(own, tmp_path, table, key, value, match):
    rows = json.loads((own / "v1.0-mini" / f"{table}.json").read_text())
    lidar = [i for i, row in enumerate(rows) if "LIDAR_TOP" in row.get("filename", "LIDAR_TOP")]
    for row in lidar:
        edit(own, table, key, value, row)
    refused(own, cache=tmp_path, match=rf"{table}\.json: {match}")


@pytest.mark.parametrize("table", ["sample_annotation", "ego_pose"])
def test_quaternions_in_another_order_are_told_by_their_lean(own, tmp_path, table):
    path = own / "v1.0-mini" / f"{table}.json"
    rows = json.loads(path.read_text())
    for i, row in enumerate(rows):
        row["rotation"] = [0.0, 0.0, math.sin(0.6 + i), math.cos(0.6 + i)]  # x y z w of a yaw
    path.write_text(json.dumps(rows))
    refused(own, cache=tmp_path, match=rf"{table}\.json: .* lean .* as w x y z")


def test_missing_calibration_tables_and_sweeps_are_named(own, tmp_path):
    with pytest.raises(BadInputError, match="scene-9: no scene of this name"):
        list(NuScenes(own, cache=tmp_path).tracks_of("scene-9"))
    scan = sorted((own / "samples" / "LIDAR_TOP").iterdir())[0]
    scan.write_bytes(scan.read_bytes()[:-3])
    passed_over(NuScenes(own, cache=tmp_path), r"pcd\.bin: \d+ bytes, expected a multiple of 20")
    scan.unlink()
    passed_over(NuScenes(own, cache=tmp_path), r"pcd\.bin: no such file; unpack the blob")
    (own / "v1.0-mini" / "calibrated_sensor.json").unlink()
    refused(
        own,
        cache=tmp_path,
        match=r"calibrated_sensor\.json: no such file; unpack nuScenes' metadata",
    )


def test_an_index_that_cannot_be_written_is_one_sentence(own, tmp_path):
    (tmp_path / "file").write_text("")
    refused(own, cache=tmp_path / "file", match=r"this index of .* cannot be used")


@pytest.mark.parametrize("kind", RELATIVES)
@pytest.mark.parametrize("sweeps", [False, True])
def test_relatives_are_read_as_nuscenes_is(written, cache, tmp_path, kind, sweeps):
    """Lyft level 5, TruckScenes, T4: other folders, channels and files, the same points."""
    root = write_relative(tmp_path / kind, kind, (SECOND, FIRST))
    source = NuScenes(root, sweeps=sweeps, cache=tmp_path)
    assert source.parts() == ["scene-0061", "scene-0103"]
    found, same = tracks(source), tracks(NuScenes(written, sweeps=sweeps, cache=cache))
    assert set(found) == set(same)
    assert len(found) > 0
    for name, track in found.items():
        assert len(track.scans) == len(same[name].scans)
        for scan, other in zip(track.scans, same[name].scans):
            np.testing.assert_array_equal(scan, other)


def test_t4_says_how_many_numbers_a_point_has(written, cache, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    root = write_relative(tmp_path / "t4", "t4", (SECOND, FIRST))
    for file in root.glob("data/*/*.bin"):
        rows = np.fromfile(file, "<f4").reshape(-1, 5)
        np.column_stack((rows, rows[:, 3:])).tofile(file)
    (root / "info.json").write_text('{"num_pts_feats": 7, "sources": []}')
    table = root / "annotation" / "sample_data.json"
    rows = [row | {"info_filename": "info.json"} for row in json.loads(table.read_text())]
    table.write_text(json.dumps(rows))
    source = NuScenes(root, cache=tmp_path)
    found, same = tracks(source), tracks(NuScenes(written, cache=cache))
    assert set(found) == set(same)
    for name, track in found.items():
        for scan, other in zip(track.scans, same[name].scans, strict=True):
            np.testing.assert_array_equal(scan, other)
    drive = open_scene(root / "scene-0061")
    assert len(drive.read(0).points) > 500
    (root / "info.json").write_text('{"num_pts_feats": "many"}')
    with pytest.raises(BadInputError, match=r"info\.json: num_pts_feats is many, expected 4 to 64"):
        tracks(source)


def test_the_lidar_can_be_named(own, tmp_path):
    assert NuScenes(own, cache=tmp_path, lidar="LIDAR_TOP").parts() == ["scene-0103"]
    with pytest.raises(BadInputError, match=r"no sensor LIDAR_LEFT, found LIDAR_TOP; .* --lidar"):
        NuScenes(own, cache=tmp_path, lidar="LIDAR_LEFT").parts()


def test_objects_whose_tokens_begin_alike_stay_apart(own, tmp_path):
    """As in tables of one's own, whose tokens are words and numbers."""
    table = own / "v1.0-mini" / "instance.json"
    (row,) = json.loads(table.read_text())
    rows = [row | {"token": f"instance-token-{number}"} for number in (1, 2)]
    table.write_text(json.dumps(rows))
    table = own / "v1.0-mini" / "sample_annotation.json"
    first, second = json.loads(table.read_text())
    first["instance_token"], second["instance_token"] = (row["token"] for row in rows)
    table.write_text(json.dumps([first, second]))
    found = list(NuScenes(own, cache=tmp_path).tracks_of("scene-0103"))
    assert [track.name for track in found] == [f"scene-0103_{row['token']}" for row in rows]
    assert [len(track.scans) for track in found] == [1, 1]
