# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses that came with a drive, and those of an odometry that was held back, against its scans."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.drives.street import HEIGHT, scan, street, things
from tests.drives.test_odd_drives import LEVEL, drive_of

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.given_poses import held_back
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Turn
from wildshape.simulate.shapes.solid import box, cylinder

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")


def test_an_odometry_that_was_held_back_is_said():
    seen = street(frames=8)
    whole = seen.scans[0]
    left = whole[np.arctan2(whole[:, 1], whole[:, 0]) > 1.5]
    for scans, told in (
        (seen.scans, "first scans do not lie on the last"),
        ([whole] * 8, ""),
        ([*[whole] * 7, left], ""),  # recordings end amid a turn
    ):
        found = held_back(drive_of(scans), SE3.identity(8), LEVEL, DriveConfig())
        assert told in found
        assert bool(found) == bool(told)
    assert held_back(drive_of(seen.scans), path_of(seen.places), LEVEL, DriveConfig()) == ""


def test_poses_that_do_not_fit_the_scans_are_said():
    """Right ones, inverse ones, scans in the world, a camera's axes, other scales, none at all."""
    seen = street(frames=8)
    path = path_of(seen.places)
    turn = torch.tensor(((0, -1, 0, 5e5), (1, 0, 0, 5e6), (0, 0, 1, 90), (0, 0, 0, 1.0)))
    T_map_sensor = SE3.from_matrix(turn.double()) @ path
    placed = [path[frame].apply_numpy(scan) for frame, scan in enumerate(seen.scans)]
    camera = SE3.from_matrix(torch.eye(4).double()[[1, 2, 0, 3]])
    late = torch.tensor([0.0] * 5 + [1.5] * 3).double()[:, None] * torch.eye(3).double()[0]
    for scans, poses, told in (
        (seen.scans, T_map_sensor, None),
        (seen.scans, T_map_sensor.inverse(), "inverse of the poses fits the scans better"),
        (placed, path, "lie better on each other without them"),
        (seen.scans, camera @ path @ camera.inverse(), "without them"),
        (seen.scans, SE3(path.rotation, 100 * path.translation), "without them: give T_world_"),
        (seen.scans, SE3(path.rotation, path.translation / 2), "a wrong scale, order or frame"),
        (seen.scans, path[torch.arange(7, -1, -1)], "in the order of the scans"),
        (seen.scans, SE3(path.rotation, path.translation + late), "jump at frame 5"),
        (seen.scans, SE3(path.rotation, 1.1 * path.translation), "with all ways 0.9 times as long"),
        (seen.scans, SE3.identity(8), "the sensor hardly moves, but its scans do not"),
        ([seen.scans[0]] * 8, SE3.identity(8), None),
    ):
        drive = replace(drive_of(scans), T_world_sensor=poses)
        found = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert len(found) == bool(told)
        assert (told or "") in "".join(found)


def test_a_jump_of_poses_is_said_where_steps_are_uneven():
    """By whole scans the steps themselves change more than where the poses jump."""
    at = np.cumsum([0, *(3, 2) * 5, 3])
    places = np.column_stack((1.4 * at, 0 * at))
    seen = [scan(things(), place, frame) for frame, place in enumerate(places)]
    jumped = places + np.outer(at >= 10, (1.6, 0.0))
    for given, told in ((places, []), (jumped, ["jump at frame 4"])):
        poses, times = path_of(given), (0.04 * at).tolist()
        drive = Drive.of("street", ["a"] * 12, lambda frame: Turn(seen[frame]), times, poses)
        found = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert len(found) == len(told)
        assert all(word in said for word, said in zip(told, found))


def test_right_poses_amid_traffic_are_not_doubted():
    """Half of what is seen drives elsewhere; half a metre beside less fits."""
    seen = street(frames=8)
    path = path_of(seen.places)
    low, high = (-28.0, -28.0, -1.0), (28.0, 28.0, 8.0)
    driving = np.random.default_rng(0).uniform(low, high, size=(20_000, 3)).astype(np.float32)
    ahead = np.array((1.3, 0.0, 0.0), np.float32)
    scans = [np.concatenate((scan, driving + i * ahead)) for i, scan in enumerate(seen.scans)]
    half = SE3(path.rotation, path.translation / 2)
    for poses, told in ((path, []), (half, ["a wrong scale, order or frame"])):
        drive = replace(drive_of(scans), T_world_sensor=poses)
        found = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert len(found) == len(told)
        assert all(word in said for word, said in zip(told, found))


def test_poses_whose_z_looks_down_or_whose_frame_is_turned_are_said():
    """On a nearly straight way what the near scans show hardly differs."""
    seen = street(frames=10)
    angle = torch.tensor(math.radians(1.5), dtype=torch.float64)
    T_sensor_car = SE3(rotation_z(angle), torch.zeros(3, dtype=torch.float64))
    scans = [T_sensor_car.apply_numpy(scan) for scan in seen.scans]
    path = path_of(seen.places) @ T_sensor_car.inverse()
    turn = torch.diag(torch.tensor((1.0, -1.0, -1.0), dtype=torch.float64))
    axes = SE3(turn, torch.zeros(3, dtype=torch.float64))
    turned = SE3(rotation_z(torch.tensor(math.radians(4.0)).double()), torch.zeros(3).double())
    for poses, told in (
        (path, []),
        (axes @ path @ axes, ["y and z reversed"]),
        (path @ turned, ["turned by 4 degrees about"]),
        (drifting(path, 0.4), ["turned by 0.4 degrees more each scan"]),
        (drifting(path, -0.2), ["turned by 0.2 degrees more each scan"]),
    ):
        drive = replace(drive_of(scans), T_world_sensor=poses)
        found = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert len(found) == len(told)
        assert all(word in said for word, said in zip(told, found))


def test_poses_of_the_scan_before_or_after_are_said():
    """Between scans where the sensor turns by more and by less."""
    frames = torch.arange(-1, 15).double()
    turns = SE3(rotation_z(0.02 * torch.sin(0.8 * frames)), torch.zeros(16, 3).double())
    places = np.column_stack((frames, 0 * frames))
    seen = [scan(things(), place, frame) for frame, place in enumerate(places[1:-1])]
    scans = [turn.inverse().apply_numpy(points) for turn, points in zip(turns[1:], seen)]
    path = path_of(places) @ turns
    for first, told in ((0, ["for the scan before it"]), (1, []), (2, ["for the scan after it"])):
        drive = replace(drive_of(scans), T_world_sensor=path[torch.arange(first, first + 14)])
        found = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert len(found) == len(told)
        assert all(word in said for word, said in zip(told, found))


def test_the_ground_of_a_sensor_that_is_tilted_counts_for_nothing():
    """Its rings lie around the sensor wherever it is: where little else stands they hid that."""
    road = box((-80.0, -80.0, -HEIGHT - 0.5), (120.0, 80.0, -HEIGHT))
    at = ((6, 7), (11, -8), (17, 9), (25, -7), (31, 8), (-8, 7), (-12, -9), (38, -6))
    poles = [
        cylinder(np.array((x, y, -HEIGHT)), np.array((x, y, 2.0)), (0.3, 0.3), 8) for x, y in at
    ]
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    R_level_sensor = np.array(((c, 0, s), (0, 1, 0), (-s, 0, c)))
    tilted = Mounting(HEIGHT, 30.0, tuple(R_level_sensor[2].tolist()))
    seen = [scan([road, *poles], (float(frame), 0.0), frame) for frame in range(8)]
    scans = [(points @ R_level_sensor).astype(np.float32) for points in seen]
    found = held_back(drive_of(scans), SE3.identity(8), tilted, DriveConfig())
    assert "first scans do not lie on the last" in found


def test_a_heading_that_drifts_is_told_by_the_scan_and_not_by_the_file():
    """Between the fifth scan and the sixth five are missing."""
    seen, kept = street(frames=12), [0, 1, 2, 3, 4, 10, 11]
    names = [f"{number:06d}" for number in kept]
    for degrees in (0.1, 0.2):
        poses = drifting(path_of(seen.places), degrees)[torch.tensor(kept)]
        drive = Drive.of("street", names, lambda f: Turn(seen.scans[kept[f]]), None, poses)
        (told,) = find_trajectory(drive, LEVEL, DriveConfig()).breaks.told()
        assert f"turned by {degrees} degrees more each scan" in told


def drifting(path, degrees):
    """Each step turned so much too far."""
    turn = rotation_z(torch.tensor(math.radians(degrees)).double())
    poses = [path[0]]
    for frame in range(1, len(path)):
        step = path[frame - 1].inverse() @ path[frame]
        poses.append(poses[-1] @ step @ SE3(turn, torch.zeros(3).double()))
    return SE3.from_matrix(torch.stack([pose.matrix for pose in poses]))


def path_of(places):
    """`T_world_sensor` of a sensor that looks along x."""
    moved = np.column_stack((places, np.zeros(len(places))))
    return SE3(torch.eye(3).double().repeat(len(places), 1, 1), torch.from_numpy(moved))
