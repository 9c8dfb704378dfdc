# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Our reader of KITTI tracking reads what is written; an interrupted drive goes on."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.cars import poses_of

from wildshape.datasets.kitti.calibration import read_calibration, rigid
from wildshape.datasets.kitti.oxts import read_oxts
from wildshape.datasets.kitti.tracking import KittiTracking
from wildshape.datasets.kitti.tracking_labels import read_boxes
from wildshape.datasets.tracks.selection import Selection
from wildshape.io.boxes.table import read_box_table
from wildshape.io.poses import read_poses
from wildshape.io.scans.points import read_points
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

CONFIG = StreetConfig(scans=4, sensor="hdl32", noise_m=0.0, compensated=True)


@pytest.fixture(scope="module")
def drive() -> WholeDrive:
    return WholeDrive(CONFIG, 11)


@pytest.fixture(scope="module")
def written(drive: WholeDrive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("drive")
    found = write_drive(drive, out)
    assert found.scans == 4
    assert found.points == sum(len(drive.scan(i).points) for i in range(4))
    return out


def _content(folder: Path) -> dict[str, bytes]:
    files = [file for file in folder.rglob("*") if file.is_file()]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def test_scans_are_kittis(drive: WholeDrive, written: Path) -> None:
    rows = np.fromfile(written / "velodyne" / "0000" / "000002.bin", "<f4").reshape(-1, 4)
    made = drive.scan(2)
    np.testing.assert_array_equal(rows[:, :3], made.points)
    assert (rows[:, 3] >= 0).all()
    assert (rows[:, 3] <= 1).all()
    assert len(list((written / "velodyne" / "0000").glob("*.bin"))) == 4


def test_our_reader_of_kitti_tracking_finds_the_vehicles(drive: WholeDrive, written: Path) -> None:
    boxes = {
        (number, box.track): box
        for number in range(4)
        for box in drive.scan(number).boxes
        if box.kind != "Pedestrian"
    }
    found = 0
    for track in KittiTracking(written, Selection(min_points=100)).tracks_of("0000"):
        for name, scan, T in zip(
            track.scan_names, track.scans, poses_of(track).matrix.numpy(), strict=True
        ):
            box = boxes[int(name), int(track.name.rsplit("_", 1)[1])]
            np.testing.assert_allclose(T[:3, 3], box.T_sensor_object[:3, 3], atol=1e-5)
            ahead = T[:2, 0] / np.linalg.norm(T[:2, 0])
            true = box.T_sensor_object[:2, 0] / np.linalg.norm(box.T_sensor_object[:2, 0])
            np.testing.assert_allclose(ahead, true, atol=1e-4)
            if not box.moving:
                assert abs(len(scan) - box.points) < 0.1 * box.points + 5
            found += 1
    assert found >= 10


def test_pedestrians_are_labelled_as_such(drive: WholeDrive, written: Path) -> None:
    labels = read_boxes(written / "label_02" / "0000.txt")
    said = {(box.frame, box.track, box.category) for box in labels}
    true = {(i, box.track, box.kind) for i in range(4) for box in drive.scan(i).boxes}
    assert said == true
    assert "Pedestrian" in {kind for *_, kind in said}


def test_parked_vehicles_stand_still_in_the_world_of_the_gps(written: Path) -> None:
    parked = Selection(min_points=50, motion="parked")
    assert list(KittiTracking(written, parked).tracks_of("0000"))


def test_the_way_of_the_gps_is_the_sensor_s(drive: WholeDrive, written: Path) -> None:
    path = written / "calib" / "0000.txt"
    T_velo_imu = rigid(read_calibration(path, ""), ("Tr_imu_velo",), path)
    T_world_velo = read_oxts(written / "oxts" / "0000.txt") @ T_velo_imu.inverse()
    true = np.stack([drive.scan(i).T_world_sensor for i in range(4)])
    relative = (T_world_velo[0].inverse() @ T_world_velo).matrix.numpy()
    np.testing.assert_allclose(relative, np.linalg.inv(true[0]) @ true, atol=1e-6)
    np.testing.assert_allclose(T_world_velo.rotation[:, 2], true[:, 2, :3], atol=1e-9)


def test_poses_times_and_truth(drive: WholeDrive, written: Path) -> None:
    poses = read_poses(written / "poses" / "0000.txt").matrix.numpy()
    np.testing.assert_allclose(poses, [drive.scan(i).T_world_sensor for i in range(4)], atol=1e-9)
    times = (written / "velodyne" / "0000" / "times.txt").read_text().split()
    assert [float(time) for time in times] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    rows = [row for row in read_box_table(written / "truth" / "0000.csv") if row.frame == 0]
    first = [box for box in drive.scan(0).boxes if box.kind != "Pedestrian"]
    assert [(row.track, row.points) for row in rows] == [(str(b.track), b.points) for b in first]
    assert [row.moving for row in rows] == [box.moving for box in first]
    places = [(row.x, row.y, row.z) for row in rows]
    np.testing.assert_allclose(places, [b.T_sensor_object[:3, 3] for b in first], atol=1e-5)


@pytest.mark.parametrize("left", [0, 2, 3])
def test_an_interrupted_drive_goes_on(
    drive: WholeDrive, written: Path, tmp_path: Path, left: int
) -> None:
    """Killed while scan `left` was written: after its lines, before its points."""
    out = tmp_path / "drive"
    seen: list[int] = []

    def killed(done: int) -> None:
        seen.append(done)
        if done == left + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_drive(drive, out, killed)
    (out / "velodyne" / "0000" / f"{left:06d}.bin").unlink()
    kept = {path: path.stat().st_mtime_ns for path in out.rglob("*.bin")}
    write_drive(drive, out)
    assert _content(out) == _content(written)
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())


@pytest.mark.parametrize("rows_left", [0, 2])
def test_killed_while_the_lines_of_scans_are_removed(
    drive: WholeDrive, written: Path, tmp_path: Path, rows_left: int
) -> None:
    out = tmp_path / "drive"
    shutil.copytree(written, out)
    for number in range(rows_left):
        (out / ".rows").mkdir(exist_ok=True)
        (out / ".rows" / f"{number:06d}.json").write_text("{}")
    assert write_drive(drive, out).scans == 4
    assert _content(out) == _content(written)


def test_the_time_of_each_point(tmp_path: Path) -> None:
    """It is that of its azimuth: from behind over the right side."""
    drive = WholeDrive(replace(CONFIG, scans=1, compensated=False, speed=0.0), 11)
    write_drive(drive, tmp_path, point_times=True)
    path = tmp_path / "scans" / "0000" / "000000.ply"
    np.testing.assert_array_equal(read_points(path), drive.scan(0).points)
    head, _, body = path.read_bytes().partition(b"end_header\n")
    names = re.findall(r"property float (\w+)", head.decode())
    assert names == ["x", "y", "z", "intensity", "time"]
    rows = np.frombuffer(body, "<f4").reshape(-1, 5)
    turned = np.arctan2(rows[:, 1], rows[:, 0]) / (2 * np.pi)
    np.testing.assert_allclose(rows[:, 4], 0.1 * turned, atol=2e-4)
