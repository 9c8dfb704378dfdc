# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is odd about a recording is said, and nothing of a good one."""

import numpy as np
import pytest
import torch

from wildshape.drives.config import LinkConfig
from wildshape.drives.recording_checks import (
    backwards_told,
    clock_told,
    rate_told,
    sideways_told,
    tipped_told,
)
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.source import Drive
from wildshape.geometry.transforms.rotation import rotation_from_vector
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Turn


def test_scans_that_are_copies_of_the_ones_before_are_said(tmp_path):
    rng = np.random.default_rng(0)
    scans = [rng.normal(size=(500, 3)).astype(np.float32) for _ in range(3)]
    nothing = np.empty((0, 3), np.float32)
    for number, scan in enumerate(
        [scans[0], scans[1], scans[1], scans[1], scans[2], *[nothing] * 2]
    ):
        np.save(tmp_path / f"{number}.npy", scan)
    (told,) = open_drive(tmp_path).warnings
    assert told.startswith("2 scans equal to the one before, to the last bit; the first: frame 2")


def test_times_of_points_that_are_no_turn_s_are_not_used_and_told_of():
    def drive_of(turn_s, times):
        turn = Turn(np.zeros((200, 3), np.float32), np.linspace(0.0, turn_s, 200))
        return Drive.of("street", ["a0", "a1", "a2"], lambda _: turn, times)

    good, degrees, still = (drive_of(s, (5.0, 5.1, 5.2)) for s in (0.11, 0.36, 0.0012))
    assert good.turn(1).seconds is not None
    assert clock_told(good) == []
    assert degrees.turn(1).seconds is None
    assert "cannot be used: a turn would last much longer" in clock_told(degrees)[0]
    (told,) = clock_told(still)
    assert told.startswith("times of a scan's points lie within 1.2 ms, as of a sensor whose clock")
    assert "without a times.txt they are not corrected" in clock_told(drive_of(0.1, None))[0]


@pytest.mark.parametrize(
    ("field", "times", "told"),
    [
        ("t", (1.7e9, 1.7e9), "cannot be used: from 1700000000 to 1700000000 is no turn"),
        ("ts", (-0.05, 0.05), "the field ts is not read as times of points"),
        ("scalar_Time", (-0.05, 0.05), "the field scalar_Time is not read as times of points"),
        ("GPSTime", (-0.05, 0.05), "the field GPSTime is not read as times of points"),
        ("timestamp_ns", (0.0, 1e8), "the field timestamp_ns is not read as times of points"),
        ("scalar_GpsTime", (0.0, 0.0), ""),
        ("t", (-0.05, 0.05), ""),
        ("intensity", (0.0, 1.0), ""),
    ],
)
def test_times_of_points_that_cannot_be_used_in_any_scan_are_told_of(tmp_path, field, times, told):
    rows = np.zeros(1000, [(name, "<f8") for name in ("x", "y", "z", "last")])
    rows["last"] = np.linspace(times[0], times[1], 1000)
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 1000\n" + "".join(
        f"property double {name}\n" for name in ("x", "y", "z", field)
    )
    for frame in range(2):
        rows["x"] = np.arange(1000) + frame
        scan = head.encode() + b"end_header\n" + rows.tobytes()
        (tmp_path / f"{frame}.ply").write_bytes(scan)
    (tmp_path / "times.txt").write_text("5.0\n5.1\n")
    warnings = open_drive(tmp_path).warnings
    assert len(warnings) == bool(told)
    assert told in "".join(warnings)


def test_only_recordings_of_few_scans_a_second_are_told_to_lose_fast_vehicles():
    def told(scan_s):
        return rate_told(scan_s, 0.0, LinkConfig())

    assert told(None) == told(0.1) == told(0.05) == told(0.2) == []
    assert "at 2 scans a second" in told(0.5)[0]
    assert "above 18 m/s always" in told(0.5)[0]


def test_scans_in_reverse_order_are_said():
    """Of three streets in reverse order 18 of 18 vehicles drove backwards, of others 3 of 134."""
    (told,) = backwards_told([True] * 5 + [False])
    assert told.startswith("5 of 6 moving vehicles drive backwards by their shapes: the scans are")
    for turned in ([], [True, True], [True] * 3 + [False] * 3):
        assert backwards_told(turned) == []


@pytest.mark.parametrize("rolled_deg", [0.0, 50.0])
def test_a_sensor_that_tips_on_its_way_is_told_of_and_not_one_that_turns(rolled_deg):
    """Of scans cut down to their vehicles odometry rolled over by 55 degrees, unsaid."""

    def about(axis, degrees):
        return rotation_from_vector(torch.tensor(axis, dtype=torch.float64) * np.radians(degrees))

    mounted = about([1.0, 0.0, 0.0], rolled_deg)
    up = mounted.T[:, 2].tolist()

    def way(axis, degrees):
        turned = [mounted.T @ about(axis, degrees * part) @ mounted for part in (0.0, 0.5, 1.0)]
        return SE3(torch.stack(turned), torch.zeros(3, 3, dtype=torch.float64))

    assert tipped_told(way([0.0, 0.0, 1.0], 170.0), up) == []
    assert tipped_told(way([0.0, 1.0, 0.0], 20.0), up) == []
    (told,) = tipped_told(way([0.0, 1.0, 0.0], 55.0), up)
    assert told.startswith("the sensor tips by 55 degrees, more than on any road")


@pytest.mark.parametrize(
    ("mounted_deg", "frames", "step_m", "told"),
    [
        (0, 12, 1.0, ""),
        (30, 12, 1.0, ""),
        (90, 12, 1.0, "goes to its right"),
        (-90, 12, 1.0, "goes to its left"),
        (180, 12, 1.0, "goes backwards"),
        (90, 12, 0.4, ""),
        (90, 600, 0.01, ""),
    ],
)
def test_a_sensor_that_does_not_go_where_its_x_looks_is_told_of(mounted_deg, frames, step_m, told):
    """It follows a bend; `mounted_deg`: of its x against the vehicle's, counterclockwise."""
    bend = np.radians(20.0) * np.arange(frames)
    places = np.cumsum(step_m * np.stack([np.cos(bend), np.sin(bend), 0 * bend], 1), axis=0)
    yaw = bend + np.radians(mounted_deg)
    zero, one = np.zeros(frames), np.ones(frames)
    rows = [np.cos(yaw), -np.sin(yaw), zero, np.sin(yaw), np.cos(yaw), zero, zero, zero, one]
    way = SE3(torch.from_numpy(np.stack(rows, 1).reshape(frames, 3, 3)), torch.from_numpy(places))
    names = [f"{frame:03}" for frame in range(frames)]
    points = np.ones((200, 3), np.float32)
    untimed = Drive.of("street", names, lambda _: Turn(points))
    assert told in "".join(sideways_told(untimed, way))
    assert bool(sideways_told(untimed, way)) == bool(told)
    timed = Turn(points, np.linspace(0.0, 0.1, 200))
    times = [0.1 * frame for frame in range(1, frames + 1)]
    assert sideways_told(Drive.of("street", names, lambda _: timed, times), way) == []
    assert sideways_told(Drive.of("street", names, lambda _: Turn(points), None, way), way) == []
