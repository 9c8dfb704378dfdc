# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scan has the sensor's rings, lies on the object, and loses what it should."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from wildshape.simulate.raycast import Scene
from wildshape.simulate.scan import Returns, rays, scan, window
from wildshape.simulate.sensor import HDL32, HDL64, OS1_128, SpinningLidar
from wildshape.simulate.shapes.solid import Solid, box
from wildshape.simulate.shapes.vehicle import vehicle

_LIDARS = (HDL64, HDL32, OS1_128)
_CLEAN = Returns(noise_m=0.0, dropout=0.0, glass=1.0, ground=False)


def _car() -> Solid:
    return vehicle("sedan", np.random.default_rng(1)).centred()


def _pose(x: float, y: float, yaw: float, car: Solid) -> np.ndarray:
    """T_object_sensor on the object's ground, 1.73 m high."""
    c, s = np.cos(yaw), np.sin(yaw)
    height = 1.73 - float(car.bounds[1, 2])
    return np.array(((c, -s, 0, x), (s, c, 0, y), (0, 0, 1, height), (0, 0, 0, 1.0)))


def _elevation(points: np.ndarray) -> np.ndarray:
    return np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def test_beam_tables_are_the_makers() -> None:
    table = np.array(HDL64.elevation_deg)
    assert len(table) == 64
    np.testing.assert_allclose(np.diff(table[:32]), -1 / 3, atol=1e-9)
    np.testing.assert_allclose(np.diff(table[32:]), -0.5, atol=1e-9)
    assert (table[0], table[-1]) == (2.0, -24.33)
    assert (len(HDL32.elevation_deg), len(OS1_128.elevation_deg)) == (32, 128)
    np.testing.assert_allclose(np.diff(HDL32.elevation_deg), -1.3335, atol=1e-3)


@pytest.mark.parametrize("lidar", _LIDARS, ids=lambda s: s.name)
def test_rings_of_a_scan_are_the_beam_table(lidar: SpinningLidar) -> None:
    car = _car()
    noisy = Returns(0.02, 0.1, 0.5, ground=False)
    points, *_ = scan(
        Scene([car]), car, lidar, _pose(6, 4, 2.5, car), noisy, np.random.default_rng(0)
    )
    off = np.abs(_elevation(points)[:, None] - np.array(lidar.elevation_deg)).min(1)
    assert off.max() < 1e-4


def test_lost_pulses_pass_the_glass_and_come_back_from_behind_it() -> None:
    car, other = _car(), vehicle("van", np.random.default_rng(0)).moved(np.array((9.0, 0.0, -0.7)))
    dark = Returns(noise_m=0.0, dropout=0.0, glass=0.0, ground=False)
    T, scene = _pose(3, 6, -1.9, car), Scene([car, other])
    outside, inside = (
        scan(scene, car, HDL64, T, replace(dark, through=share), np.random.default_rng(0))
        for share in (0.0, 1.0)
    )
    assert inside.on_target == len(inside.points) > len(outside.points) + 50
    at = inside.points @ T[:3, :3].T + T[:3, 3]
    half = car.bounds[1]
    assert (np.abs(at) < half + 0.01).all()
    mesh = trimesh.Trimesh(car.vertices, car.faces, process=False)
    _, off, _ = trimesh.proximity.closest_point_naive(mesh, at[::23])
    assert off.max() < 1e-4
    far_side = at[:, 1] < -0.5 * half[1]
    assert far_side.sum() > 20
    assert len(inside.lost) < len(outside.lost)


@pytest.mark.parametrize("yaw", [0.3, 2.6, -2.6, -0.6])
def test_rays_of_the_window_miss_nothing(yaw: float) -> None:
    """As many hits as with all pulses of a full turn, also across the azimuth seam."""
    car = _car()
    T = _pose(5, -3, yaw, car)
    scene = Scene([car])
    bounds = window(T, car.bounds[1])
    few = rays(HDL64, bounds, 0.05, T[:3, :3])
    behind = bounds[0] - 150
    every = rays(HDL64, (behind, behind + 359.9, -90.0, 90.0), 0.05, T[:3, :3])
    hits = [
        np.isfinite(scene.cast(np.tile(T[:3, 3], (len(d), 1)), d).distance).sum()
        for d in (few, every)
    ]
    assert abs(int(hits[0]) - int(hits[1])) <= 4
    assert hits[0] > 1000
    assert len(few) < 0.1 * len(every)


def test_clean_hits_lie_on_the_surface_and_noise_along_the_ray() -> None:
    car = _car()
    T = _pose(7, 3, 2.8, car)
    clean, count, *_ = scan(Scene([car]), car, HDL64, T, _CLEAN, np.random.default_rng(0))
    assert count == len(clean) > 1000
    mesh = trimesh.Trimesh(car.vertices, car.faces, process=False)
    on_object = clean[::23] @ T[:3, :3].T + T[:3, 3]
    _, off, _ = trimesh.proximity.closest_point_naive(mesh, on_object)
    assert off.max() < 1e-4


def test_noise_has_the_stated_sigma_along_the_ray() -> None:
    wall = box((-0.1, -3.0, -1.0), (0.1, 3.0, 1.0))
    T = np.eye(4)
    T[:3, 3] = -8.0, 0.0, 0.0
    noisy = Returns(0.02, 0.0, 1.0, ground=False)
    points, *_ = scan(Scene([wall]), wall, HDL64, T, noisy, np.random.default_rng(0))
    range_m = np.linalg.norm(points, axis=1)
    depth_error = (points[:, 0] - 7.9) * range_m / points[:, 0]
    assert depth_error.std() == pytest.approx(0.02, rel=0.05)
    assert abs(depth_error.mean()) < 0.001


def test_dropout_dark_glass_and_occluders_take_points_away() -> None:
    car = _car()
    T = _pose(8, 4, 3.0, car)
    alone = Scene([car])

    def count(scene: Scene, returns: Returns) -> int:
        return scan(scene, car, HDL64, T, returns, np.random.default_rng(0))[1]

    full = count(alone, _CLEAN)
    assert count(alone, Returns(0.0, 0.2, 1.0, ground=False)) == pytest.approx(0.8 * full, rel=0.05)
    assert count(alone, Returns(0.0, 0.0, 0.05, ground=False)) < 0.95 * full
    pole = box((3.8, 1.6, -2.0), (4.2, 2.0, 2.0))
    assert 0 < count(Scene([car, pole]), _CLEAN) < 0.9 * full


def test_ground_option_adds_a_low_rim_only() -> None:
    car = _car()
    T = _pose(6, 4, 2.5, car)
    with_ground, scene = Returns(0.0, 0.0, 1.0, ground=True), Scene([car])
    points, on_car, phase, _ = scan(scene, car, HDL64, T, with_ground, np.random.default_rng(0))
    every = rays(HDL64, (-180.0, 179.9, -90.0, 90.0), phase, T[:3, :3])
    down = every[every[:, 2] < -0.01]
    reach = (car.bounds[0, 2] - T[2, 3]) / down[:, 2]
    rim = (np.abs(T[:2, 3] + reach[:, None] * down[:, :2]) <= car.bounds[1, :2] + 0.3).all(1)
    first = reach < scene.cast(np.tile(T[:3, 3], (len(down), 1)), down).distance
    assert abs(len(points) - on_car - int((rim & first).sum())) <= 4
    assert len(points) > on_car > 100
    on_object = points @ T[:3, :3].T + T[:3, 3]
    low = on_object[on_object[:, 2] < car.bounds[0, 2] + 1e-3]
    assert len(low) >= len(points) - on_car
    assert (np.abs(low[:, :2]) <= car.bounds[1, :2] + 0.301).all()
