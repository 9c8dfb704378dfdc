# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The ground holds the sensor level; of the way along it says nothing."""

import numpy as np
import pytest
import torch

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.ground_map import GroundMap
from wildshape.drives.tracking.mounting import find_mounting
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.geometry.transforms.rotation import rotation_from_vector, smallest_turn
from wildshape.records import Turn
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

CONFIG = DriveConfig().trajectory


def pose(place, vector):
    T = np.eye(4)
    T[:3, :3] = rotation_from_vector(torch.tensor(vector, dtype=torch.float64)).numpy()
    T[:3, 3] = place
    return T


def ground(T_world_sensor, seed):
    """Of a road that rises sideways, as seen from a pose."""
    points = np.random.default_rng(seed).uniform(-15, 15, (1500, 3))
    points[:, 2] = -1.7 + 0.03 * points[:, 1]
    return (points - T_world_sensor[:3, 3]) @ T_world_sensor[:3, :3]


@pytest.mark.parametrize("mounted_deg", [0.0, 20.0])
def test_height_and_tilt_come_from_the_ground_and_the_way_from_the_pose(mounted_deg):
    mounted = pose((0, 0, 0), (0, np.deg2rad(mounted_deg), 0))
    up = mounted[:3, :3].T @ (0.0, 0.0, 1.0)
    true = pose((1.0, 0.3, 0.05), (0.01, -0.02, 0.2)) @ mounted
    off = true @ pose((0.0, 0.0, 0.1), (0.02, 0.015, 0.0))
    found = GroundMap(CONFIG, up)
    found.levelled(mounted, ground(mounted, 1).astype(np.float32))
    levelled = found.levelled(off, ground(true, 2).astype(np.float32))
    np.testing.assert_allclose(levelled[:3, :3] @ up, true[:3, :3] @ up, atol=1e-3)
    vertical = true[:3, :3] @ up
    assert vertical @ (levelled - true)[:3, 3] == pytest.approx(0.0, abs=0.01)
    moved = (levelled - off)[:3, 3]
    np.testing.assert_allclose(moved, vertical * (vertical @ moved), atol=1e-3)
    turned = levelled[:3, :3] @ off[:3, :3].T
    axis = (turned - turned.T)[(2, 0, 1), (1, 2, 0)]
    assert axis @ vertical == pytest.approx(0.0, abs=1e-4)


def test_hardly_any_ground_changes_nothing():
    T = pose((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    found = GroundMap(CONFIG, np.array((0.0, 0.0, 1.0)))
    assert found.levelled(T, np.empty((0, 3), np.float32)) is T
    assert found.levelled(T, ground(T, 1)[:10]) is T


def test_the_smallest_turn_takes_one_direction_to_the_other_about_their_common_normal():
    start, end = np.array((0.6, 0.0, 0.8)), np.array((0.0, 1.0, 0.0))
    turn = smallest_turn(start, end)
    np.testing.assert_allclose(turn @ start, end, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(turn @ np.cross(start, end), np.cross(start, end), atol=1e-12)


def test_a_sensor_of_few_beams_does_not_climb():
    """By points on points alone its pitch was off by half a degree after 20 m."""
    street = WholeDrive(StreetConfig(scans=20, sensor="hdl32", speed=10.0), 23)
    scans = [street.scan(frame) for frame in range(20)]
    turns = [Turn(scan.points.astype(np.float32)) for scan in scans]
    drive = Drive.of("street", [f"{frame:06d}" for frame in range(20)], turns.__getitem__)
    way = find_trajectory(drive, find_mounting(drive, DriveConfig().mounting), DriveConfig())
    true = np.stack([scan.T_world_sensor for scan in scans])
    off = np.linalg.inv(np.linalg.inv(true[0]) @ true) @ way.T_world_sensor.matrix.numpy()
    assert np.rad2deg(np.arcsin(-off[5:, 2, 0]).mean()) == pytest.approx(0.0, abs=0.25)
    assert np.abs(off[:, 2, 3]).max() < 0.1
