# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A whole drive, from its scans to boxes.csv, against its truth."""

import json
import math
import shutil
import weakref
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from pyarrow import feather
from tests.drives.street import HEIGHT
from tests.io.test_atomic_lock import held
from tests.refusal import refused

import wildshape
from wildshape.drives.config import DriveConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.tracking.segmentation import Cutter, read_cut
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.drives.writing.files import DriveFiles
from wildshape.geometry.footprint import footprint_iou
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.io.boxes.detections import read_detections
from wildshape.io.boxes.table import HEADER, read_box_table
from wildshape.io.poses import read_poses, read_tum
from wildshape.io.scans.points import read_points
from wildshape.io.tracks import read_track
from wildshape.records import Turn

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")


LEVEL = Mounting(1.7, 0.0, (0.0, 0.0, 1.0))


def test_the_trajectory_is_the_sensor_s_way(found, truth):
    places = read_poses(found.out / "trajectory.txt", len(truth.scans)).translation.numpy()
    assert np.abs(places[:, :2] - truth.places).max() < 0.1
    times, poses = read_tum(found.out / "trajectory.tum")
    assert times == pytest.approx([0.1 * frame for frame in range(len(truth.scans))])
    assert np.allclose(poses.translation.numpy(), places)


def test_every_car_is_one_track_and_nothing_else_is(found, truth):
    rows = read_box_table(found.out / "boxes.csv")
    owners = {}
    for row in rows:
        shares = {
            name: footprint_iou(
                np.array((row.x, row.y, row.z, row.yaw)),
                (row.length, row.width),
                np.array((*way[row.frame][:2] - truth.places[row.frame], 0.0, way[row.frame][2])),
                tuple(map(float, truth.sizes[name][:2])),
            )
            for name, way in truth.cars.items()
        }
        best = max(shares, key=lambda name: shares[name])
        assert shares[best] > 0.5, (row, shares)
        owners.setdefault(best, set()).add((row.track, row.moving))
        assert row.time == pytest.approx(0.1 * row.frame)
    assert set(owners) == set(truth.cars)
    assert all(len(tracks) == 1 for tracks in owners.values()), owners
    assert {
        name: moving for name, ((_, moving),) in ((n, tuple(t)) for n, t in owners.items())
    } == {
        "near": False,
        "left": False,
        "far": False,
        "moving": True,
    }


def test_boxes_stand_on_the_road_and_are_as_high_as_the_cars(found, truth):
    heights = dict[str, float]()
    for row in read_box_table(found.out / "boxes.csv"):
        assert row.z - row.height / 2 == pytest.approx(-HEIGHT, abs=0.05), row
        heights[row.track] = row.height
    known = sorted(size[2] for size in truth.sizes.values())
    assert sorted(heights.values()) == pytest.approx(known, abs=0.12)


def test_shapes_stand_in_their_boxes_where_they_were_completed(found):
    off = []
    for row in read_box_table(found.out / "boxes.csv"):
        scan = found.out / "objects" / row.track / "completed" / f"{row.frame:06d}.ply"
        if scan.is_file():
            shape = read_points(found.out / "shapes" / f"{row.track}.ply")
            off.append(row.z + shape[:, 2].mean() - read_points(scan)[:, 2].mean())
    assert np.mean(off) == pytest.approx(0.0, abs=0.01)


def test_a_moving_car_looks_where_it_drives(found, truth):
    rows = [row for row in read_box_table(found.out / "boxes.csv") if row.moving]
    assert rows
    for row in rows:
        assert math.cos(row.yaw - truth.cars["moving"][row.frame][2]) > 0.9


def test_what_is_written_is_what_the_documents_say(found, truth):
    out = found.out
    assert (out / "boxes.csv").read_text("utf-8").splitlines()[0] == (
        "frame,time,track,x,y,z,length,width,height,yaw,confidence,points,moving"
    )
    assert ",".join(HEADER) == (out / "boxes.csv").read_text("utf-8").splitlines()[0]
    rows = read_box_table(out / "boxes.csv")
    assert len(rows) == found.boxes
    assert set(found.vehicles) == {row.track for row in rows}
    assert set(found.vehicles) == {folder.name for folder in (out / "tracks").iterdir()}
    assert set(found.vehicles) == {folder.name for folder in (out / "objects").iterdir()}
    frames = (out / "frames.csv").read_text("utf-8").splitlines()
    assert frames[0] == "frame,scan,time,points"
    assert frames[2].startswith(f"1,000001,0.1,{len(truth.scans[1])}")
    said = json.loads((out / "wildshape.json").read_text("utf-8"))
    assert said["status"] == "finished"
    assert said["settings"]["drive"]["clusters"]["range_m"] == 60.0


def test_tracks_and_objects_are_those_of_the_other_commands(found):
    names = {row.track for row in read_box_table(found.out / "boxes.csv")}
    boxes = read_detections(found.out / "objects")
    assert {one.track for one in boxes} == names
    for name in names:
        track = read_track(found.out / "tracks" / name)
        rows = [row for row in read_box_table(found.out / "boxes.csv") if row.track == name]
        assert len({(row.length, row.width, row.height) for row in rows}) == 1
        seen = {f"{row.frame:06d}": row.points for row in rows if row.points}
        assert {n: len(s) for n, s in zip(track.scan_names, track.scans)} == seen
        assert track.rays == ()
        completed = {path.stem for path in (found.out / "objects" / name / "completed").iterdir()}
        assert completed == {one.scan for one in boxes if one.track == name} <= set(seen)


@pytest.mark.usefixtures("only_helpers")
def test_several_processes_find_the_same(found, recording, tmp_path):
    files = DriveFiles(BoxFiles(("json", "kitti")))
    spread = wildshape.drive(recording, tmp_path / "out", workers=2, files=files)
    assert (spread.vehicles, spread.workers) == (found.vehicles, 2)
    assert (spread.out / "boxes.csv").read_bytes() == (found.out / "boxes.csv").read_bytes()
    rows = read_box_table(spread.out / "boxes.csv")
    listed = json.loads((spread.out / "boxes" / "boxes.json").read_text("utf-8"))["boxes"]
    assert {(box["scan"], box["track"]) for box in listed} == {
        (f"{row.frame:06d}", row.track) for row in rows
    }
    (labels,) = (spread.out / "boxes" / "kitti").iterdir()
    assert labels.name == "recording.txt"
    places = [tuple(map(int, line.split()[:2])) for line in labels.read_text().splitlines()]
    assert places == sorted(places)
    assert len(places) == len(rows)


def test_a_finished_drive_gets_other_files_and_is_not_found_again(found, recording, monkeypatch):
    def never(*_):
        raise AssertionError("the drive was gone through again")

    monkeypatch.setattr(Pipeline, "perform", never)
    boxes = (found.out / "boxes.csv").stat().st_mtime_ns
    files = DriveFiles(BoxFiles(("json", "kitti", "nuscenes", "argoverse2")), mesh="glb")
    assert wildshape.drive(recording, found.out, files=files) == found
    assert (found.out / "boxes.csv").stat().st_mtime_ns == boxes
    sizes = {row.track: (row.length, row.width, row.height) for row in _rows(found)}
    for name in found.vehicles:
        mesh = trimesh.load_mesh(found.out / "meshes" / f"{name}.glb")
        assert mesh.is_watertight
        assert mesh.bounds == pytest.approx(np.outer((-0.5, 0.5), sizes[name]), abs=0.3)
    _boxes_are_those_of_the_table(found)


def _rows(found):
    return read_box_table(found.out / "boxes.csv")


def _boxes_are_those_of_the_table(found):
    """Each format's boxes, one by one; columns as their formats' documents have them."""
    rows, folder = _rows(found), found.out / "boxes"
    for line in (folder / "kitti" / "recording.txt").read_text().splitlines():
        frame, _, kind, *numbers = line.split()
        height, width, length, x, y, z, turn, score = map(float, numbers[7:])
        at = (z, -x, -y + height / 2, length, width, height, score)
        (row,) = [r for r in rows if r.frame == int(frame) and abs(r.x - z) + abs(r.y + x) < 0.01]
        assert kind == "Car"
        assert (row.x, row.y, row.z, row.length, row.width, row.height, row.confidence) == (
            pytest.approx(at, abs=1e-3)
        )
        assert math.cos(row.yaw + turn + math.pi / 2) == pytest.approx(1, abs=1e-3)
    table = feather.read_table(folder / "argoverse2" / "annotations.feather").to_pylist()
    keys = {(row.frame, row.track): row for row in rows}
    assert len(table) == len(rows)
    for one in table:
        row = keys[round(one["timestamp_ns"] / 1e8), one["track_uuid"]]
        assert (one["tx_m"], one["num_interior_pts"]) == (pytest.approx(row.x), row.points)
    results = json.loads((folder / "nuscenes.json").read_text())["results"]
    assert sum(map(len, results.values())) == len(rows)
    for one in (one for some in results.values() for one in some):
        row = keys[int(one["sample_token"]), one["tracking_id"]]
        assert one["size"] == pytest.approx([row.width, row.length, row.height])
        speed = 9.0 if row.moving else 0.0  # metres a second: 0.9 m a frame
        assert math.hypot(*one["velocity"]) == pytest.approx(speed, abs=1.5)


def test_poses_beside_the_scans_skip_the_odometry(recording, truth, tmp_path):
    folder = shutil.copytree(recording, tmp_path / "with_poses")
    lines = [f"1 0 0 {x} 0 1 0 {y} 0 0 1 0\n" for x, y in truth.places + 7.0]
    (folder / "poses.txt").write_text("".join(lines))
    drive = open_drive(folder)
    poses = find_trajectory(drive, LEVEL, DriveConfig()).T_world_sensor
    assert poses.translation.numpy()[:, :2] == pytest.approx(truth.places)


def test_scans_are_in_memory_one_by_one(recording, tmp_path):
    drive = open_drive(recording)
    alive = weakref.WeakSet()
    most = 0

    class Held(np.ndarray):
        __hash__ = object.__hash__  # pyright: ignore[reportAssignmentType]

    def read(frame):
        nonlocal most
        scan = np.load(recording / f"{frame:06d}.npy").view(Held)
        alive.add(scan)
        most = max(most, len(alive))
        return Turn(scan)

    object.__setattr__(drive, "read", read)
    find_trajectory(drive, LEVEL, DriveConfig())
    cutter = Cutter(drive, LEVEL, tmp_path / "cuts", DriveConfig())
    for frame in cutter.missing():
        cutter(frame)
    assert cutter.missing() == []
    assert most <= 2


def test_a_scan_is_read_once_for_the_way_and_its_clusters(recording, tmp_path):
    drive = open_drive(recording)
    read = drive.read
    frames = []
    object.__setattr__(drive, "read", lambda frame: frames.append(frame) or read(frame))
    cutter = Cutter(drive, LEVEL, tmp_path / "cuts", DriveConfig())
    scans = map(cutter.landmarks, range(len(drive)))
    found = find_trajectory(drive, LEVEL, DriveConfig(), scans=scans)
    assert frames == list(range(len(drive)))
    assert cutter.missing() == []
    alone = find_trajectory(drive, LEVEL, DriveConfig())
    assert torch.equal(found.T_world_sensor.matrix, alone.T_world_sensor.matrix)
    again = replace(cutter, folder=tmp_path / "again")
    again(3)
    cut, other = (read_cut(one.folder, 3) for one in (cutter, again))
    assert np.array_equal(cut.points, other.points)
    assert np.array_equal(cut.points, drive.scan(3)[cut.rows])


def test_three_scans_an_empty_and_a_damaged_one_are_warnings(recording, tmp_path, monkeypatch):
    folder = tmp_path / "few"
    folder.mkdir()
    for name in ("000000.npy", "000001.npy", "000002.npy"):
        shutil.copy(recording / name, folder)
    np.save(folder / "000003.npy", np.empty((0, 3), np.float32))
    (folder / "000005.npy").write_bytes(b"damaged")
    monkeypatch.chdir(tmp_path)
    few = wildshape.drive("few")
    assert few.out.resolve() == tmp_path / "found"
    assert few.frames == 5
    assert few.warnings == (
        "1 scan missing between the others",
        "2 of 5 scans are empty or cannot be read",
        "3 scans with points: too few to tell which vehicles move",
    )
    assert few.vehicles
    with held(few.out):  # by `wildshape drive` in a terminal, say
        pass


def test_what_is_no_drive_is_refused(tmp_path):
    folder = tmp_path / "object"
    folder.mkdir()
    rng = np.random.default_rng(0)
    np.save(folder / "0.npy", rng.uniform((8, -1, 0), (12, 1, 1.5), (500, 3)))
    refused(
        wildshape.drive, folder, tmp_path / "out", match=f"^{folder}: .* single objects, cut out"
    )
    (folder / "0.npy").write_bytes(b"damaged")
    refused(wildshape.drive, folder, tmp_path / "other", match="expected a numpy array")
    refused(wildshape.drive, tmp_path / ("n" * 300), tmp_path / "more", match="name too long")
