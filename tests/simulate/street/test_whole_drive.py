# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated drive: what its boxes hold, who hides whom, and when each point was measured."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.refusal import refused

from wildshape.simulate.raycast import Scene
from wildshape.simulate.sensor import HDL32, SENSORS
from wildshape.simulate.shapes.vehicle import vehicle
from wildshape.simulate.street.sweep import cast_turn
from wildshape.simulate.street.whole_drive import PERIOD_S, StreetConfig, WholeDrive

CLEAN = StreetConfig(scans=40, sensor="hdl32", dropout=0.0, noise_m=0.0)
MOVERS_SMEAR_M, ROUNDING_M = 0.5, 2e-3


@pytest.fixture(scope="module")
def compensated() -> WholeDrive:
    return WholeDrive(replace(CLEAN, compensated=True), 3)


@pytest.fixture(scope="module")
def raw() -> WholeDrive:
    return WholeDrive(CLEAN, 3)


def _moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.einsum("...ij,...j->...i", T[..., :3, :3], points) + T[..., :3, 3]


@pytest.mark.parametrize("number", [0, 25])
def test_a_box_holds_what_was_cast_on_its_object_and_nothing_else(
    compensated: WholeDrive, number: int
) -> None:
    scan = compensated.scan(number)
    assert {b.track for b in scan.boxes} == set(np.unique(scan.owner[scan.owner >= 0]))
    for box in scan.boxes:
        inside = np.abs(_moved(np.linalg.inv(box.T_sensor_object), scan.points))
        own = scan.owner == box.track
        assert box.points == own.sum()
        half = np.asarray(box.size) / 2
        slack = MOVERS_SMEAR_M if box.moving else ROUNDING_M
        whole = np.asarray(compensated.actors[box.track].size) / 2
        assert (inside[own] <= whole + slack).all()
        if box.kind == "Pedestrian":
            assert (half == whole).all()
        elif not box.moving and own.sum() >= 200:  # of a vehicle, mirrors alone stick out
            assert (inside[own, 1] > half[1] + ROUNDING_M).mean() < 0.1
            assert half[1] < whole[1] - 0.1
        if box.kind == "Pedestrian":  # people walk through each other
            continue
        # The ground reaches a little into the box, and grass a little over the ground.
        above = _moved(np.linalg.inv(box.T_sensor_object), scan.points)[:, 2] > 0.15 - half[2]
        assert not ((inside < half - 0.05).all(1) & above & ~own).any()


def test_a_box_is_around_the_body_of_a_vehicle_with_one_mirror(tmp_path: Path) -> None:
    car = vehicle("sedan", np.random.default_rng(0))
    faces = car.faces[car.parts < car.parts.max()]  # the left mirror is the last part
    trimesh.Trimesh(car.vertices, faces, process=False).export(tmp_path / "car.ply")
    across = car.vertices[faces][..., 1]
    middle = np.array((0.0, -(across.min() + across.max()) / 2, 0.0))  # of the body, box frame
    drive = WholeDrive(replace(CLEAN, speed=0.0, meshes=tmp_path), 3)
    T_world_sensor = drive.sensor_pose(np.zeros(1))[0]
    parked = [box for box in drive.scan(0).boxes if not box.moving and box.kind == "Car"]
    assert parked
    for box in parked:
        T_world_shape = drive.street.pose(drive.actors[box.track], np.zeros(1))[0]
        T_label_shape = np.linalg.inv(T_world_sensor @ box.T_sensor_object) @ T_world_shape
        np.testing.assert_allclose(_moved(T_label_shape, middle), 0.0, atol=5e-3)


def test_a_pulse_ends_at_the_nearest_of_all_things_at_its_own_time(raw: WholeDrive) -> None:
    """One scene of everything, made anew for the time of each of some columns."""
    number = 20
    times = number * PERIOD_S + raw._turn.times
    T_world_sensor = raw.sensor_pose(times)
    block = int(raw.street.ego.at(number * PERIOD_S) // 40)
    movers = raw._movers(times, T_world_sensor)
    echoes = cast_turn(raw._block(block), movers, raw._turn, T_world_sensor)
    on_movers = {a.track for a in raw.actors if a.moving}
    assert np.isin(echoes.owner, list(on_movers)).sum() > 100
    still = raw._solids(block)[0]
    columns = np.flatnonzero(np.isin(echoes.owner, list(on_movers)).any(0))[::40]
    for column in columns:
        here = [
            raw._placed(actor, float(times[column]))
            for actor in raw.actors
            if actor.moving and -140 < actor.motion.at(times[column]) < 160
        ]
        toward = raw._turn.directions[:, column] @ T_world_sensor[column, :3, :3].T
        origins = np.broadcast_to(T_world_sensor[column, :3, 3], toward.shape)
        at_once = Scene([*still, *here]).cast(origins, toward)
        near = at_once.distance < 100
        np.testing.assert_allclose(
            echoes.distance[near, column], at_once.distance[near], rtol=1e-4, atol=1e-3
        )


def test_points_are_measured_from_where_the_sensor_is_then(
    raw: WholeDrive, compensated: WholeDrive
) -> None:
    as_measured, moved = raw.scan(12), compensated.scan(12)
    T_world_sensor = raw.sensor_pose(as_measured.time + as_measured.times.astype(float))
    world = _moved(T_world_sensor, as_measured.points.astype(float))
    np.testing.assert_allclose(
        world, _moved(moved.T_world_sensor, moved.points.astype(float)), atol=1e-3
    )
    way = np.linalg.norm(as_measured.points - moved.points, axis=1)
    ahead = np.abs(as_measured.times) < 1e-4
    assert way[ahead].max() < 0.03
    assert 0.2 < way.max() < 2.0


def test_a_box_of_what_moves_is_where_the_beam_met_it(raw: WholeDrive) -> None:
    scan, far = raw.scan(20), []
    for box in scan.boxes:
        x, y = box.T_sensor_object[:2, 3]
        since = np.interp(np.arctan2(y, x), raw._turn.azimuth, raw._turn.times)
        time, actor = np.array((scan.time + since,)), raw.actors[box.track]
        T = np.linalg.inv(raw.sensor_pose(time)[0]) @ raw.street.pose(actor, time)[0]
        T[:3, 3] += raw.street.label(actor)[1] * T[:3, 1]
        np.testing.assert_allclose(box.T_sensor_object, T, atol=5e-3)
        way = raw.street.pose(actor, np.array((scan.time,)))[0] - raw.street.pose(actor, time)[0]
        far.append(np.linalg.norm(way[:3, 3]))
    assert max(far) > 0.1


def test_standing_still_there_is_nothing_to_compensate() -> None:
    still = replace(CLEAN, speed=0.0)
    as_measured = WholeDrive(still, 3).scan(5)
    moved = WholeDrive(replace(still, compensated=True), 3).scan(5)
    np.testing.assert_allclose(as_measured.points, moved.points, atol=1e-5)
    poses = WholeDrive(still, 3).sensor_pose(np.linspace(0, 4, 9))
    np.testing.assert_allclose(poses, np.broadcast_to(poses[0], poses.shape), atol=1e-12)


def test_a_seed_is_a_drive(raw: WholeDrive) -> None:
    again = WholeDrive(CLEAN, 3)
    last, first = again.scan(30), again.scan(7)
    np.testing.assert_array_equal(first.points, raw.scan(7).points)
    np.testing.assert_array_equal(last.owner, raw.scan(30).owner)
    other = WholeDrive(CLEAN, 4).scan(7)
    assert len(other.points) != len(first.points) or (other.points != first.points).any()


def _near(middles: np.ndarray, i: int, sensor: np.ndarray) -> np.ndarray:
    """The vehicles before the i-th that may touch it, where the sensor may see them."""
    apart = np.linalg.norm(middles[:i] - middles[i], axis=1)
    seen = np.linalg.norm(middles - sensor, axis=1) < 125
    return np.flatnonzero((apart < 12) & seen[:i] & seen[i])


@pytest.mark.parametrize("seed", range(3))
def test_no_two_vehicles_meet(seed: int) -> None:
    drive = WholeDrive(replace(CLEAN, scans=150), seed)
    vehicles = [actor for actor in drive.actors if actor.kind != "Pedestrian"]
    for time in (0.0, 14.9):
        poses = np.stack([drive.street.pose(a, np.array((time,)))[0] for a in vehicles])
        middles = poses[:, :2, 3]
        sensor = drive.sensor_pose(np.array((time,)))[0, :2, 3]
        assert np.linalg.norm(middles - sensor, axis=1).min() > 2.0
        for i, one in enumerate(vehicles):
            for j in _near(middles, i, sensor):
                grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 9)] * 2), -1).reshape(-1, 2)
                mine = np.column_stack((grid * one.size[:2], np.zeros(len(grid))))
                theirs = _moved(np.linalg.inv(poses[j]) @ poses[i], mine)[:, :2]
                assert (np.abs(theirs) > np.asarray(vehicles[j].size[:2]) / 2).any(1).all()


def test_the_ground_is_not_flat_and_the_road_falls_to_its_sides(raw: WholeDrive) -> None:
    s = np.linspace(-80, 120, 401)
    middle = raw.street.height(s, np.zeros(401))
    kerb = raw.street.height(s, np.full(401, raw.street.half_m - 0.01))
    pavement = raw.street.height(s, np.full(401, raw.street.half_m + 0.01))
    assert np.ptp(middle) > 0.2
    assert np.abs(np.diff(middle) / 0.5).max() < 0.08
    np.testing.assert_allclose(pavement - kerb, 0.12, atol=0.02)


@pytest.mark.parametrize("heading", [0.0, 0.5 * np.pi, np.pi, -2.0])
def test_what_stands_on_the_road_leans_as_the_road_does(raw: WholeDrive, heading: float) -> None:
    """Its wheels are on the ground, before, behind, to the left and to the right."""
    s, lateral = np.arange(-80.0, 120.0, 0.5), -1.65
    T = raw.street.standing(s, lateral, heading, 0.0)
    wheels = np.array(((1.3, 0.0, 0.0), (-1.3, 0.0, 0.0), (0.0, 0.7, 0.0), (0.0, -0.7, 0.0)))
    off = []
    for x, y, _ in wheels:
        along = x * np.cos(heading) - y * np.sin(heading)
        aside = x * np.sin(heading) + y * np.cos(heading)
        ground = raw.street.height(s + along, np.full(len(s), lateral + aside))
        off.append(_moved(T, np.array((x, y, 0.0)))[:, 2] - ground)
    assert np.abs(off).max() < 0.01
    assert np.abs(T[:, 2, 0]).max() > 0.01


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"scans": 0}, "at least 1"),
        ({"sensor": "depth-camera"}, "needs a LiDAR"),
        ({"speed": -1.0}, "0 to 40"),
        ({"dropout": 1.0}, "0 to below 1"),
        ({"noise_m": float("nan")}, "0 or more"),
    ],
)
def test_bad_settings(changed: dict, said: str) -> None:
    refused(replace, CLEAN, **changed, match=said)


def test_a_lidar_that_is_added_is_named_where_one_is_needed(monkeypatch) -> None:
    monkeypatch.setitem(SENSORS, "added", replace(HDL32, name="added"))
    refused(replace, CLEAN, sensor="depth-camera", match="hdl64, hdl32, os1-128, added")
