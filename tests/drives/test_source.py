# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where drives come from: folders, KITTI's layouts, times and poses beside the scans."""

import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.drives.frame_cache import FrameCache
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.source import Drive
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.poses import write_poses
from wildshape.parallel.helper import Helper
from wildshape.records import Turn

NO_POINTS = Turn(np.empty((0, 3), np.float32))


@pytest.fixture
def folder(tmp_path):
    write_scans(tmp_path / "drive", range(4))
    return tmp_path / "drive"


def turn_of(frame):
    return Turn(np.full((1, 3), frame, np.float32))


def write_scans(folder, numbers):
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        rows = np.full((50, 4), number, np.float32)
        rows.tofile(folder / f"{number:06d}.bin")


def test_names_sorted_are_the_order_in_time(folder):
    drive = open_drive(folder)
    assert (len(drive), drive.name, drive.times) == (4, "drive", None)
    assert drive.scan_names == ("000000", "000001", "000002", "000003")
    assert [float(drive.scan(frame)[0, 0]) for frame in range(4)] == [0, 1, 2, 3]
    assert (drive.ticks, drive.warnings) == ((0, 1, 2, 3), ())


@pytest.mark.parametrize("before", ["", "scan_", "frame-"])
def test_numbers_without_leading_zeros_are_refused(tmp_path, before):
    """As text 10 comes before 9."""
    for number in (9, 10):
        np.save(tmp_path / f"{before}{number}.npy", np.ones((50, 3)))
    refused(open_drive, tmp_path, match=f"{before}10.npy is sorted before {before}9.npy")


@pytest.mark.parametrize("suffix", [".5.npy", ".500000000.npy", ".pcd.bin"])
def test_seconds_and_numbers_of_nuscenes_without_leading_zeros_are_refused(tmp_path, suffix):
    for number in (9, 10):
        (tmp_path / f"{number}{suffix}").write_bytes(b"0")
    refused(open_drive, tmp_path, match=f"10{suffix} is sorted before 9{suffix}")


def test_decimals_in_names_are_no_counts(tmp_path):
    for name in ("1.25", "1.5", "a2", "b1"):
        np.save(tmp_path / f"{name}.npy", np.ones((50, 3)))
    assert open_drive(tmp_path).scan_names == ("1.25", "1.5", "a2", "b1")


def test_a_missing_scan_is_counted_and_leaves_its_time_out(tmp_path):
    write_scans(tmp_path, (7, 8, 11))
    drive = open_drive(tmp_path)
    assert drive.ticks == (0, 1, 4)
    assert drive.warnings == ("2 scans missing between the others",)


@pytest.mark.parametrize(
    ("names", "ticks"),
    [
        (("scan_07", "scan_08", "scan_11"), (0, 1, 4)),
        (("l-10.pcd", "l-20.pcd", "l-30.pcd", "l-50.pcd"), (0, 1, 2, 4)),
        (("17.10", "17.20", "17.30", "18.30"), (0, 1, 2, 12)),
        (("20260131_125958", "20260131_125959", "20260131_130000"), (0, 1, 2)),
        (("a2", "b3", "b7"), (0, 1, 2)),
    ],
)
def test_names_count_behind_what_they_share_but_not_the_time_of_day(tmp_path, names, ticks):
    for name in names:
        np.ones((50, 5), np.float32).tofile(tmp_path / f"{name}.bin")
    assert open_drive(tmp_path).ticks == ticks


@pytest.mark.parametrize(
    "numbers",
    [
        (10, 20, 30, 60),
        tuple(1700000000123456789 + late for late in (0, 100_000_321, 199_999_876, 500_000_000)),
    ],
)
def test_names_that_count_by_tens_or_are_stamps_of_a_clock(tmp_path, numbers):
    write_scans(tmp_path, numbers)
    drive = open_drive(tmp_path)
    assert (drive.ticks, drive.scan_names) == ((0, 1, 2, 5), tuple(f"{n:06d}" for n in numbers))


def test_no_scan_is_missing_where_the_mean_step_is_not_the_middle_one():
    times = np.cumsum([0.1, 0.1, 0.1, 0.101] * 200).tolist()
    drive = Drive.of("drive", [f"{n:06d}" for n in range(800)], lambda _: NO_POINTS, times)
    assert (drive.ticks, drive.warnings) == (tuple(range(800)), ())


def test_times_beside_the_scans_are_seconds(folder):
    (folder / "times.txt").write_text("5.0\n5.1\n5.2\n5.5\n")
    drive = open_drive(folder)
    assert drive.times == (5.0, 5.1, 5.2, 5.5)
    assert drive.ticks == (0, 1, 2, 5)


def test_of_a_time_for_each_number_those_of_the_scans_are_taken(tmp_path):
    write_scans(tmp_path, (2, 3, 4, 7))
    (tmp_path / "times.txt").write_text("".join(f"{0.1 * n:.1f}\n" for n in range(8)))
    drive = open_drive(tmp_path)
    assert (drive.times, drive.ticks) == ((0.2, 0.3, 0.4, 0.7), (0, 1, 2, 5))


def test_poses_beside_the_scans_are_used(folder):
    poses = SE3.identity(4)
    write_poses(folder / "poses.txt", poses)
    found = open_drive(folder).T_world_sensor
    assert found is not None
    assert len(found) == 4


def test_byte_order_marks_are_no_part_of_times_and_poses(folder):
    write_poses(folder / "poses.txt", SE3.identity(4))
    (folder / "times.txt").write_text("5.0\n5.1\n5.2\n5.3\n")
    plain = open_drive(folder)
    for name in ("times.txt", "poses.txt"):
        (folder / name).write_text("\ufeff" + (folder / name).read_text(), "utf-8")
    assert open_drive(folder).fingerprint == plain.fingerprint


def test_kitti_raw_and_odometry(tmp_path):
    raw = tmp_path / "2011_09_26_drive_0048_sync"
    write_scans(raw / "velodyne_points" / "data", range(3))
    stamps = [f"2011-09-26 13:02:25.{n}67208721\n" for n in (1, 2, 3)]
    (raw / "velodyne_points" / "timestamps.txt").write_text("".join(stamps))
    drive = open_drive(raw)
    assert (drive.name, len(drive)) == (raw.name, 3)
    assert drive.times is not None
    assert np.diff(drive.times) == pytest.approx([0.1, 0.1], abs=1e-5)
    odometry = tmp_path / "00"
    write_scans(odometry / "velodyne", range(3))
    (odometry / "times.txt").write_text("0.0\n1.036e-01\n2.073e-01\n")
    (odometry / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)  # a camera's: not used
    found = open_drive(odometry)
    assert (found.ticks, found.T_world_sensor) == ((0, 1, 2), None)


def test_what_cannot_be_a_drive_is_refused_in_a_sentence(folder, tmp_path):
    refused(open_drive, tmp_path / "none", match="no such folder")
    (tmp_path / "empty").mkdir()
    refused(open_drive, tmp_path / "empty", match="holds no scan")
    (tmp_path / "empty" / "a.pcap").touch()
    refused(open_drive, tmp_path / "empty", match="empty: holds recordings; name each, .*a.pcap")
    (tmp_path / "bags" / "monday").mkdir(parents=True)
    (tmp_path / "bags" / "monday" / "monday_0.mcap").touch()
    refused(open_drive, tmp_path / "bags", match="bags: holds recordings; name each, .*bags/monday")
    (tmp_path / "a.bin").touch()
    refused(open_drive, tmp_path / "a.bin", match="a file of another kind; a drive is a folder")
    (folder / "times.txt").write_text("1\n2\n3\n")
    refused(open_drive, folder, match="times.txt: 3 times for 4 scans")
    (folder / "times.txt").write_text("1\n2\n1.5\n3\n")
    refused(open_drive, folder, match=rf"^{folder}: time 3 \(1.5\) is not after")
    (folder / "times.txt").write_text("1\n2\n2\n3\n")
    refused(open_drive, folder, match=rf"^{folder}: time 3 \(2\) is the same as the one before")
    (folder / "times.txt").write_text("1\n2\nnan\n3\n")
    refused(open_drive, folder, match="not finite")
    (folder / "times.txt").write_text("100\n200\n300\n500\n")
    refused(
        open_drive, folder, match="times.txt: 100 s from one scan to the next; write its times in"
    )
    (folder / "times.txt").write_text("".join(f"{at / 600}\n" for at in range(4)))  # minutes
    refused(open_drive, folder, match="0.00166667 s from one scan .*; write its times in seconds")
    (folder / "times.txt").unlink()
    (folder / "3.bin").touch()
    refused(open_drive, folder, match=f"^{folder}: of 000000 to 3 some share a number")
    (folder / "3.bin").unlink()
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    refused(open_drive, folder, match="1 lines of poses for 4 scans")
    (folder / "poses.txt").unlink()
    np.save(folder / "000001.npy", np.zeros((3, 3)))
    refused(open_drive, folder, match="are one frame")


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_times_of_points_in_scan_files(tmp_path, suffix):
    rows = np.zeros(200, [(name, "<f4") for name in ("x", "y", "z")] + [("time", "<f8")])
    rows["x"], rows["time"] = np.arange(200), np.linspace(-0.05, 0.05, 200)
    rows["y"][3] = np.nan
    names = " ".join(rows.dtype.names or ())
    heads = {
        ".ply": "ply\nformat binary_little_endian 1.0\nelement vertex 200\nproperty float x\n"
        "property float y\nproperty float z\nproperty double time\nend_header\n",
        ".pcd": f"FIELDS {names}\nSIZE 4 4 4 8\nTYPE F F F F\nPOINTS 200\nDATA binary\n",
    }
    for frame in range(2):
        (tmp_path / f"{frame}{suffix}").write_bytes(heads[suffix].encode() + rows.tobytes())
    assert open_drive(tmp_path).turn(0).seconds is None  # how long a turn takes is not known
    (tmp_path / "times.txt").write_text("5.0\n5.1\n")
    turn = open_drive(tmp_path).turn(1)
    assert turn.seconds == pytest.approx(np.delete(rows["time"], 3))
    assert turn.points[:, 0].tolist() == np.delete(rows["x"], 3).tolist()


@pytest.mark.parametrize("begun", [0.0, -0.3, 1e9])
@pytest.mark.parametrize("first", [-0.1, -0.05, 0.0])
@pytest.mark.parametrize("on_clock", [True, False])
def test_a_clock_that_began_just_now_counts_all_turns_alike(tmp_path, begun, first, on_clock):
    """Whether a turn's first point is stamped, its middle or its last."""
    head = "FIELDS x y z time\nSIZE 4 4 4 8\nTYPE F F F F\nPOINTS 200\nDATA binary\n"
    times = [begun + 0.1 * frame for frame in range(8)]
    for frame, time in enumerate(times):
        rows = np.ones(200, [(name, "<f4") for name in ("x", "y", "z")] + [("time", "<f8")])
        rows["time"] = np.linspace(0.0, 0.1, 200) + first + on_clock * time
        (tmp_path / f"{frame}.pcd").write_bytes(head.encode() + rows.tobytes())
    (tmp_path / "times.txt").write_text("".join(f"{time:.1f}\n" for time in times))
    drive = open_drive(tmp_path)
    for frame in range(8):
        turn = drive.turn(frame)
        assert turn.seconds is not None
        assert turn.seconds[0] == pytest.approx(first, abs=1e-6)


def test_frames_asked_for_last_are_read_once_and_as_many_are_kept_as_there_is_room_for():
    read = []

    def give(frame):
        read.append(frame)
        return turn_of(frame)

    held = FrameCache(give, room=32 * turn_of(0).nbytes)
    for frame in (*range(40), *range(8, 40)):
        assert held(frame).points[0, 0] == frame
    assert read == list(range(40))
    held(0)
    held(8)  # given up for it
    assert read == [*range(40), 0, 8]


def test_threads_may_ask_at_once():
    held = FrameCache(turn_of, room=3 * turn_of(0).nbytes)
    frames = [frame for frame in range(6) for _ in range(2)] * 2000
    with ThreadPoolExecutor(8) as threads:
        for frame, turn in zip(frames, threads.map(held, frames)):
            assert turn.points[0, 0] == frame
    kept = [frame for frame in range(6) if frame in held]
    assert held._bytes == sum(held(frame).nbytes for frame in kept)


def test_what_is_kept_does_not_go_along_to_another_process():
    held = FrameCache(turn_of)
    held(3)
    sent = pickle.loads(pickle.dumps(held))
    assert 3 in held
    assert 3 not in sent
    assert sent(3).points.tolist() == held(3).points.tolist()


def test_another_process_keeps_what_it_read_for_its_next_task_with_that_drive(folder):
    drive, other, helper = open_drive(folder), open_drive(folder), Helper()
    try:
        helper.learn(drive.turn)
        assert len(helper.work(1).points) == 50
        (folder / "000001.bin").unlink()
        helper.learn(replace(drive, motion=None).turn)
        assert len(helper.work(1).points) == 50
        helper.learn(other.turn)
        assert len(helper.work(1).points) == 0
    finally:
        helper.close()


def test_a_drive_reads_frames_that_are_asked_for_again_once():
    read = []

    def give(frame):
        read.append(frame)
        return turn_of(frame)

    drive = Drive.of("drive", ["000000", "000001"], give)
    for frame in (0, 1, 0, 1):
        assert drive.turn(frame).points[0, 0] == frame
    assert read == [0, 1]


def test_text_beside_binary_scans_is_no_scan(folder):
    (folder / "gps.csv").write_text("49.0,8.4,110.0\n" * 60)
    (folder / "README.txt").write_text("49.0 8.4 110.0\n" * 60)
    assert open_drive(folder).scan_names == ("000000", "000001", "000002", "000003")


@pytest.mark.parametrize("name", ["README.txt", "README.TXT"])
def test_text_above_a_data_sets_scans_is_no_scan(tmp_path, name):
    write_scans(tmp_path / "velodyne", range(2))
    (tmp_path / name).write_text("recorded on a Monday")
    assert len(open_drive(tmp_path)) == 2


def test_scans_written_anew_in_as_many_bytes_are_another_recording(folder):
    before = open_drive(folder).fingerprint
    assert open_drive(folder).fingerprint == before
    for path in folder.glob("*.bin"):
        (-np.fromfile(path, np.float32) - 1).tofile(path)
    assert open_drive(folder).fingerprint != before


def test_a_scan_mended_in_its_first_third_is_another_recording(folder):
    before = open_drive(folder).fingerprint
    path = next(folder.glob("*.bin"))
    values = np.fromfile(path, np.float32)
    values[: len(values) // 3] += 1.0
    values.tofile(path)
    assert open_drive(folder).fingerprint != before


def test_names_that_are_no_utf8_are_spelt_out(tmp_path):
    for number in range(2):
        np.ones((50, 4), np.float32).tofile(os.fsencode(tmp_path) + b"/caf\xe9_%d.bin" % number)
    assert open_drive(tmp_path).scan_names == (r"caf\xe9_0", r"caf\xe9_1")
