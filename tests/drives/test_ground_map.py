# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The ground holds the sensor level; of the way along it says nothing."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.drives.street import HEIGHT, STEP_DEG, things

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.ground_map import GroundMap
from wildshape.drives.tracking.mounting import find_mounting
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.geometry.transforms.rotation import rotation_from_vector, smallest_turn
from wildshape.records import Turn
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import Solid, box

CONFIG = DriveConfig().trajectory
BEAMS_DEG = np.linspace(-30.67, 10.67, 32)


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
    found.see(ground(mounted, 1).astype(np.float32))
    found.add(mounted)
    found.see(ground(true, 2).astype(np.float32))
    levelled = found.levelled(off)
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
    found.see(ground(T, 1))
    found.add(T)
    for few in (0, 10):
        found.see(ground(T, 2)[:few])
        assert found.levelled(T) is T


def test_the_smallest_turn_takes_one_direction_to_the_other_about_their_common_normal():
    start, end = np.array((0.6, 0.0, 0.8)), np.array((0.0, 1.0, 0.0))
    turn = smallest_turn(start, end)
    np.testing.assert_allclose(turn @ start, end, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(turn @ np.cross(start, end), np.cross(start, end), atol=1e-12)


def hill(x):
    """Height and slope of a road that rises by 2 m over 40 m, by 8 % at most."""
    turn = 2 * np.pi * x / 80.0
    return 1.0 - np.cos(turn), np.sin(turn) * 2 * np.pi / 80.0


def over_the_hill(scans):
    """Scans and poses of a sensor that drives up between houses and parked cars."""
    x = np.arange(-80.0, 141.0)
    left, right = (np.column_stack((x, np.full(len(x), y), hill(x)[0])) for y in (80.0, -80.0))
    row = np.arange(len(x) - 1)
    faces = [(row, row + len(x), row + 1), (row + 1, row + len(x), row + 1 + len(x))]
    faces = np.concatenate([np.column_stack(one) for one in faces])
    none = np.zeros(len(faces), bool)
    road = Solid(np.concatenate((left, right)) - (0, 0, HEIGHT), faces, none, none.astype(int))
    cars = [
        box((x, y - 0.9, -HEIGHT - 0.3), (x + 4.2, y + 0.9, 1.5 - HEIGHT))
        for x in np.arange(-40.0, 100.0, 11.0).tolist()
        for y in (-4.0, 4.0)
    ]
    standing = [
        body.moved(np.array((0, 0, hill(body.vertices[:, 0].mean())[0])))
        for body in (*things()[1:], *cars)
    ]
    scene = Scene([replace(road, closed=False), *standing])
    up, around = np.deg2rad(BEAMS_DEG), np.deg2rad(np.arange(0, 360, STEP_DEG))
    e, a = (grid.ravel() for grid in np.meshgrid(up, around, indexing="ij"))
    rays = np.column_stack((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))
    poses = [pose((x, 0, hill(x)[0]), (0, -np.arctan(hill(x)[1]), 0)) for x in range(scans)]
    seen = []
    for frame, T in enumerate(poses):
        origins = np.broadcast_to(T[:3, 3], rays.shape)
        away = scene.cast(origins, rays @ T[:3, :3].T).distance
        noisy = away + np.random.default_rng(frame).normal(scale=0.015, size=len(away))
        hit = away < 80.0
        seen.append((rays[hit] * noisy[hit, None]).astype(np.float32))
    return seen, np.stack(poses)


def test_a_road_that_rises_is_followed():
    """By points on points alone the way of a sensor with 32 beams was 0.8 m off after 30 m."""
    seen, true = over_the_hill(31)
    turns = [Turn(scan) for scan in seen]
    drive = Drive.of("hill", [f"{frame:06d}" for frame in range(31)], turns.__getitem__)
    way = find_trajectory(drive, find_mounting(drive, DriveConfig().mounting), DriveConfig())
    off = way.T_world_sensor.matrix.numpy() - true
    assert np.abs(off[:, :3, 3]).max() < 0.1
