# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of published data sets, as their own layouts have them."""

import pickle
import shutil
from dataclasses import replace

import numpy as np
import pytest
from tests.datasets import write_waymo as waymo
from tests.datasets.street import street
from tests.datasets.write_argoverse2 import STAMPS, write_log
from tests.datasets.write_kitti_raw import write_drive
from tests.datasets.write_nuscenes import Scene, Thing, write_nuscenes, write_relative
from tests.datasets.write_nuscenes import off_surface as off_box
from tests.datasets.write_pandaset import AGO, write_scene
from tests.datasets.write_waymo import PERIOD, SEGMENT, START, mount, write_waymo
from tests.datasets.write_waymo import Thing as WaymoThing
from tests.refusal import refused

from wildshape.cli.main import main
from wildshape.drives.recording_checks import clock_told
from wildshape.drives.recordings import recording_kinds
from wildshape.drives.recordings.recording_kinds import find_drives, open_drive
from wildshape.io.scans.writers import write_ply

SCENE = street(frames=3)


def in_world(drive, frame):
    """A scan's points by the drive's own poses, the motion since the first frame included."""
    scan = drive.scan(frame)
    assert scan.dtype == np.float32
    return drive.T_world_sensor[frame].apply_numpy(scan.astype(np.float64))


def test_a_kind_above_folders_is_taken_for_scans_in_the_folder_itself(tmp_path, monkeypatch):
    write_ply(tmp_path / "0.ply", np.zeros((9, 3), np.float32))
    assert find_drives(tmp_path) == ("a folder of full scans", [tmp_path])
    kind = recording_kinds._Layout("of a table", lambda path: [path], recording_kinds.open_folder)
    monkeypatch.setattr(recording_kinds, "_LAYOUTS", (kind, *recording_kinds._LAYOUTS))
    assert find_drives(tmp_path).what == "of a table"


def test_argoverse2_logs(tmp_path):
    for name in ("one", "other"):
        write_log(tmp_path / "val" / name, SCENE)
    (tmp_path / "val" / "one" / "annotations.feather").unlink()  # split test has none
    what, drives = find_drives(tmp_path)
    assert what.startswith("Argoverse 2: its own poses")
    assert [drive.name for drive in drives] == ["one", "other"]
    refused(open_drive, tmp_path, match="holds 2 drives: one, other; give one")
    drive = open_drive(tmp_path / "val" / "one")
    assert drive.times == pytest.approx([stamp / 1e9 for stamp in STAMPS[:3]])
    for frame, cloud in enumerate(SCENE.clouds):
        assert np.abs(in_world(drive, frame) - cloud).max() < 0.03  # the file's float16


def test_a_sweep_without_a_pose_is_told(tmp_path):
    """The poses of all were left out without a word."""
    log = write_log(tmp_path / "log", SCENE)
    assert open_drive(log).warnings == ()
    sweep = log / f"sensors/lidar/{STAMPS[1]}.feather"
    sweep.rename(sweep.with_name(f"{STAMPS[1] + 1}.feather"))
    drive = open_drive(log)
    assert drive.T_world_sensor is None
    assert "city_SE3_egovehicle.feather lacks 1 of 3 sweeps; none of its poses are taken" in (
        drive.warnings
    )


def test_pandaset_scenes(tmp_path):
    scene = write_scene(tmp_path / "pandaset" / "001", SCENE)
    for name in ("._00.pkl.gz", "00_backup.pkl.gz"):
        (scene / "lidar" / name).write_bytes(b"left by somebody")
    what, drives = find_drives(tmp_path)
    assert what.startswith("PandaSet")
    drive = open_drive(drives[0])
    assert (drive.name, drive.scan_names, drive.ticks) == ("001", ("00", "01", "02"), (0, 1, 2))
    for frame, cloud in enumerate(SCENE.clouds):
        assert np.allclose(in_world(drive, frame), cloud, atol=1e-4)
        assert np.median(drive.scan(frame)[:, 2]) < 0  # x forward, y left, z up
        assert np.median(drive.scan(frame)[:, 0]) > 0
    for number in range(3):
        (scene / "lidar" / f"{number:02d}.pkl.gz").unlink()
    refused(open_drive, drives[0], match=r"lidar: holds none of 00\.pkl\.gz to 79\.pkl\.gz")


def test_rays_begin_where_the_sensor_was_when_it_took_them(tmp_path):
    """Points are given as seen at one moment; the sensor goes 2 m, Waymo's 1.65 m, in a turn."""
    log = write_log(tmp_path / "log", SCENE)
    scene = write_scene(tmp_path / "pandaset" / "001", SCENE)
    left = WaymoThing("left", start=(854.4, 1508.3, -50.2))  # met a quarter of a turn before
    split = write_waymo(tmp_path / "waymo" / "training", [left], frames=2)
    expected = {
        log: 0.2 * np.arange(11),
        scene: [2.0 * ago / 0.1 for ago in (*AGO.values(), 0.05)],
        split / SEGMENT: [0.4, 0.5],
    }
    for path, places in expected.items():
        full = pickle.loads(pickle.dumps(open_drive(path))).full_scan(0)
        assert full.origins is not None
        assert full.origins.shape == full.points.shape
        found = np.unique(np.linalg.norm(full.origins[:, :2], axis=1).round(1))
        assert found == pytest.approx(np.sort(places), abs=0.051)


def test_points_that_were_moved_say_when_they_were_met(tmp_path):
    """Vehicles drive on while they are met. The sensor goes at 20 m/s."""
    for path in (write_log(tmp_path / "log", SCENE), write_scene(tmp_path / "001", SCENE)):
        drive = open_drive(path)
        turn = drive.turn(1)
        assert turn.seconds is None  # no correction for the sensor's motion
        assert turn.origins is not None
        assert turn.met is not None
        away = np.linalg.norm(turn.origins[:, :2], axis=1)
        assert np.abs(turn.met).max() > 0.04
        assert away == pytest.approx(20.0 * np.abs(turn.met), abs=0.11)  # origins are of steps
        wrong = replace(turn, met=1000 * turn.met)
        assert clock_told(drive) == []
        drive = replace(drive, read=lambda _, wrong=wrong: wrong)
        assert drive.turn(1).met is None
        assert drive.turn(1).origins is turn.origins
        assert "what drives are not corrected for its motion" in clock_told(drive)[0]


def test_waymo_s_pixels_say_when_they_were_met_by_where_the_sensor_was(tmp_path, monkeypatch):
    left = WaymoThing("left", start=(854.4, 1508.3, -50.2))  # met a quarter of a turn before
    segment = write_waymo(tmp_path / "training", [left], frames=3) / SEGMENT
    drive = open_drive(segment)
    turn = drive.turn(1)
    assert turn.seconds is None
    assert turn.met is not None
    assert len(turn.met) == len(turn.points)
    ahead, aside, _ = mount()[:3, :3] @ turn.points.T  # in the vehicle's axes
    share = -np.arctan2(aside, ahead) / (2 * np.pi)
    assert turn.met == pytest.approx(share * PERIOD / 1e6, abs=0.002)
    assert turn.met.mean() < -0.02
    goes = waymo.vehicle_pose
    monkeypatch.setattr(waymo, "vehicle_pose", lambda time: goes(0 * time))
    stays = write_waymo(tmp_path / "standing", [left], frames=3) / SEGMENT
    assert open_drive(stays).turn(1).met is None


def test_a_release_that_names_no_scene_is_refused(tmp_path):
    root = write_nuscenes(tmp_path / "nuscenes", [Scene("scene-0061", (), keys=2)])
    table = next(root.rglob("scene.json"))
    table.write_text("[" + ",".join(["{}"] * 1000) + "]")
    refused(find_drives, root, match=r"scene\.json: names no scene")


def test_nuscenes_scenes(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    car = Thing("car", keys=(0, 1))
    scenes = [Scene("scene-0061", (car,), keys=2), Scene("scene-0103", (car,), keys=2)]
    root = write_nuscenes(tmp_path / "nuscenes", scenes)
    what, drives = find_drives(root)
    assert what.startswith("nuScenes")
    assert drives == [root / "scene-0061", root / "scene-0103"]
    refused(open_drive, root, match=r"holds 2 drives: scene-0061, scene-0103")
    drive = open_drive(root / "scene-0103")
    assert drive.name == "scene-0103"
    assert drive.times is not None
    assert np.diff(drive.times) == pytest.approx(0.1, abs=1e-5)
    for frame in range(len(drive)):
        rotation, place = car.pose(0.0)
        local = rotation.inv().apply(in_world(drive, frame) - place)
        assert (np.abs(off_box(local, car.size)) < 1e-3).mean() > 0.4


def test_points_of_truckscenes_have_times(tmp_path, monkeypatch):
    """They are as measured, by a lorry at 22 m/s: without times a turn is 2 m askew."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    scene = Scene("scene-1", (Thing("car", keys=(0, 1)),), keys=2)
    drive = open_drive(write_relative(tmp_path / "trucks", "truckscenes", [scene]))
    for frame in range(len(drive)):
        seconds = drive.turn(frame).seconds
        assert seconds is not None
        assert seconds[[0, -1]] == pytest.approx((-0.05, 0.05), abs=1e-3)
        assert len(seconds) == len(drive.turn(frame).points)


def test_waymo_segments(tmp_path):
    parked = WaymoThing("parked")
    split = write_waymo(tmp_path / "waymo" / "training", [parked], frames=3)
    shutil.rmtree(split / "lidar_box")  # split test has none
    (split / "lidar" / "._stray.parquet").touch()  # of an archive made on a Mac
    what, drives = find_drives(tmp_path / "waymo")
    assert what.startswith("the Waymo Open Dataset")
    assert drives == [tmp_path / "waymo" / SEGMENT]
    drive = pickle.loads(pickle.dumps(open_drive(drives[0])))
    assert drive.times == pytest.approx([(START + PERIOD * frame) / 1e6 for frame in range(3)])
    for frame in (0, 2, 1):  # in any order
        rotation, place = parked.pose(frame)
        local = rotation.inv().apply(in_world(drive, frame) - place)
        near = local[(np.abs(local) < np.array(parked.size)).all(1)]
        assert len(near) > 100
        assert np.abs(off_box(near, parked.size)).max() < 0.02


def test_kitti_s_layouts(tmp_path):
    scan = np.zeros((20, 4), np.float32)
    layouts = {
        "KITTI tracking": ("training/velodyne/0000", "testing/velodyne/0000"),
        "KITTI odometry or SemanticKITTI": ("sequences/00/velodyne", "sequences/08/velodyne"),
    }
    for what, folders in layouts.items():
        root = tmp_path / what
        for folder in folders:
            (root / folder).mkdir(parents=True)
            for frame in range(2):
                scan.tofile(root / folder / f"{frame:06d}.bin")
        found = find_drives(root)
        assert found.what == what
        assert [len(open_drive(drive)) for drive in found.drives] == [2, 2]
    raw = tmp_path / "raw" / "2011_09_26"
    for name in ("2011_09_26_drive_0001_sync", "2011_09_26_drive_0048_sync"):
        write_drive(raw / name, [], {0: np.zeros((20, 3))})
    found = find_drives(tmp_path / "raw")
    assert (found.what, len(found.drives)) == ("KITTI raw", 2)


def test_folders_of_scans_side_by_side_are_several_drives(tmp_path):
    for name in ("monday", "tuesday"):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "000000.npy", np.zeros((20, 3)))
    assert find_drives(tmp_path) == (
        "folders of full scans",
        [tmp_path / "monday", tmp_path / "tuesday"],
    )


def test_objects_cut_out_of_their_scans_are_refused(tmp_path):
    (tmp_path / "car" / "scans").mkdir(parents=True)
    write_ply(tmp_path / "car" / "scans" / "000000.ply", np.ones((20, 3), np.float32))
    for folder in (tmp_path, tmp_path / "car"):
        refused(open_drive, folder, match=r"objects that were cut out .* complete .* --track")
    found = tmp_path / "found"
    for name in ("shapes", "tracks/0001/scans"):
        (found / name).mkdir(parents=True)
        write_ply(found / name / "000000.ply", np.ones((20, 3), np.float32))
    assert find_drives(found).drives == [found]  # and not the shapes that a drive found
    refused(open_drive, found, match="objects that were cut out")
    write_drive(tmp_path / "raw", [], {0: np.zeros((20, 3))}, "velodyne_objects_xyz0")
    refused(open_drive, tmp_path / "raw", match="objects that were cut out")


def a_log(folder):
    write_log(folder, SCENE)
    return folder


def a_scene(folder):
    return write_scene(folder, SCENE)


def a_scene_of_nuscenes(folder):
    return write_nuscenes(folder, [Scene("scene-0061", (Thing("car", keys=(0, 1)),), keys=2)])


def a_segment(folder):
    return write_waymo(folder, [WaymoThing("parked")], frames=3) / SEGMENT


def a_bag(folder):
    write = pytest.importorskip("tests.io.bags.write", exc_type=ImportError)
    return write.write_bag(folder, "db3", {"/points": list(SCENE.clouds)})


def packets(folder):
    write = pytest.importorskip("tests.io.packets.write", exc_type=ImportError)
    pytest.importorskip("velodyne_decoder")
    ranges = np.full((write.PACKETS, write.BLOCKS, write.LASERS), 5000, np.uint16)
    return write.write_velodyne(folder.with_suffix(".pcap"), [ranges] * 3)


@pytest.mark.parametrize(
    ("write", "scans"),
    [
        (a_log, "sensors/lidar/*.feather"),
        (a_scene, "lidar/01.pkl.gz"),
        (a_scene_of_nuscenes, "s*/LIDAR_TOP/*.bin"),
        (a_segment, "lidar/*.parquet"),
        (a_bag, "*.db3"),
        (packets, "*.pcap"),
    ],
)
def test_a_scan_that_was_cut_off_and_copied_again_is_another_recording(
    tmp_path, monkeypatch, write, scans
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = write(tmp_path / "recording")
    before = open_drive(path).fingerprint
    assert open_drive(path).fingerprint == before
    with next(tmp_path.rglob(scans)).open("ab") as file:
        file.write(bytes(4096))
    assert open_drive(path).fingerprint != before


def test_the_command_says_what_it_took_the_source_for(tmp_path, capsys):
    for name in ("001", "002"):
        write_scene(tmp_path / name, SCENE)
    with pytest.raises(SystemExit, match="2"):
        main(["drive", str(tmp_path), "--out", str(tmp_path / "out"), "--detections", "x.json"])
    said = capsys.readouterr().err
    assert "taken for 2 drives of PandaSet: its own poses are used in place of odometry" in said
    assert "give one drive with them" in said
