# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From scans to tracks, stage by stage."""

import math

import numpy as np
import pytest
import torch
from tests.drives.street import HEIGHT, moved, scan, things

from wildshape.drives.config import (
    ClusterConfig,
    DriveConfig,
    GroundConfig,
    LinkConfig,
    MountingConfig,
    TrajectoryConfig,
)
from wildshape.drives.source import Drive
from wildshape.drives.tracking.clusters import extents, find_clusters
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import Mounting, find_mounting, ground_plane
from wildshape.drives.tracking.segmentation import Cutter
from wildshape.drives.tracking.sightings import Sightings, merged
from wildshape.drives.tracking.tracks import Seen, link
from wildshape.drives.tracking.trajectory import jumps, usual_step_m
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Turn
from wildshape.simulate.sensor import HDL64
from wildshape.simulate.shapes.vehicle import vehicle


def road(rng, count=20000, reach=30.0):
    """Points of a flat road 1.7 m below the sensor, 1 cm rough."""
    x, y = rng.uniform(-reach, reach, (2, count))
    return np.column_stack((x, y, rng.normal(-1.7, 0.01, count))).astype(np.float32)


def test_height_and_tilt_of_a_sensor_come_from_the_ground():
    rng = np.random.default_rng(0)
    walls = rng.uniform((-20, 8, -1.7), (20, 8.2, 5), (8000, 3)).astype(np.float32)
    level = np.concatenate((road(rng), walls))
    pitch = math.radians(8.0)
    c, s = math.cos(pitch), math.sin(pitch)
    R_sensor_level = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    found = ground_plane((level @ R_sensor_level.T).astype(np.float32), MountingConfig())
    assert found is not None
    assert found[3] == pytest.approx(1.7, abs=0.02)
    up = R_sensor_level @ (0.0, 0.0, 1.0)
    assert math.degrees(math.acos(found[:3] @ up)) < 0.5
    turn = Mounting(found[3], 8.0, tuple(found[:3].tolist())).levelling()
    assert torch.allclose(
        turn.rotation @ torch.from_numpy(found[:3]), torch.tensor([0.0, 0, 1]).double()
    )
    SE3.from_matrix(turn.matrix)  # a rotation


@pytest.mark.parametrize("full", [(0, 4, 11), (5,)])
def test_scans_without_points_say_nothing_of_the_ground(full):
    """Most were empty, and ground was said to be missing; or all looked at, and it was refused."""
    seen, none = Turn(road(np.random.default_rng(0))), Turn(np.empty((0, 3), np.float32))
    names = [f"{frame:06d}" for frame in range(12)]
    drive = Drive.of("street", names, lambda frame: seen if frame in full else none)
    found = find_mounting(drive, MountingConfig())
    assert found.height_m == pytest.approx(1.7, abs=0.02)
    assert found.ground > 0.9


def test_what_is_seen_of_a_cluster_is_the_middle_and_size_of_its_extent():
    many = np.array(((0, 0, 0), (0.5, 0, 0), (1, 0.2, 0), (4, 2, -1.5)), np.float32)
    seen = Seen.of(7, [many, many[:1]])
    assert seen.tick == 7
    np.testing.assert_allclose(seen.centres, ((2, 1, -0.75), (0, 0, 0)), atol=1e-6)
    np.testing.assert_allclose(seen.sizes, ((4, 2, 1.5), (0, 0, 0)), atol=1e-6)
    assert Seen.of(7, []).centres.shape == (0, 3)


@pytest.mark.parametrize("up", [(0.0, 0.0, -1.0), (0.0, 0.5, 0.5), (1.0, 0.0, 0.0)])
def test_what_is_no_vertical_is_refused(up):
    with pytest.raises(ValueError, match="the vertical is"):
        Mounting(1.7, 0.6, up)


def test_no_ground_is_found_in_a_wall_or_in_hardly_any_points():
    rng = np.random.default_rng(0)
    wall = rng.uniform((-9, 8, -1.7), (9, 8.05, 5), (5000, 3)).astype(np.float32)
    assert ground_plane(wall, MountingConfig()) is None
    assert ground_plane(road(rng, 50), MountingConfig()) is None


def test_heights_are_above_the_ground_under_each_point():
    rng = np.random.default_rng(1)
    ground = road(rng)
    slope = 0.05 * np.clip(ground[:, 0], 0, None)
    ground[:, 2] += slope
    boxes = rng.uniform((8, -1, 0), (12, 1, 1.5), (500, 3)).astype(np.float32)
    boxes[:, 2] += -1.7 + 0.05 * boxes[:, 0]
    heights = height_above_ground(np.concatenate((ground, boxes)), 1.7, GroundConfig())
    expected = boxes[:, 2] + 1.7 - 0.05 * boxes[:, 0]
    near = np.hypot(*ground[:, :2].T) > 3
    assert np.nanmedian(np.abs(heights[: len(ground)][near])) == 0.0
    high = expected > 0.4
    assert np.abs(heights[len(ground) :][high] - expected[high]).max() < 0.15


@pytest.mark.parametrize("depth_m", [8.0, 12.0])
def test_reflections_below_a_wet_road_are_no_ground(depth_m):
    """One point in ten: the road lay 7 m below the sensor, or the ground far above itself."""
    rng = np.random.default_rng(2)
    ground = road(rng)
    below = ground[:2000] - np.array((0, 0, depth_m), np.float32)
    below[:, 2] += rng.normal(0, 1, len(below))
    scan = np.concatenate((ground, below))
    plane = ground_plane(scan, MountingConfig())
    assert plane is not None
    assert plane[3] == pytest.approx(1.7, abs=0.02)
    heights = height_above_ground(scan, 1.7, GroundConfig())[: len(ground)]
    near = (np.hypot(*ground[:, :2].T) > 3) & (np.hypot(*ground[:, :2].T) < 12)
    assert np.median(heights[near]) == 0.0
    assert (np.abs(heights[near]) < 0.1).mean() > 0.95


@pytest.mark.parametrize(
    ("y", "beams_deg", "floor_m"),
    [
        (3.3, HDL64.elevation_deg, 0.15),
        (-3.0, HDL64.elevation_deg, 0.15),
        (3.6, HDL64.elevation_deg, 0.15),
        (5.0, np.linspace(-15, 15, 16), 0.45),
        (5.5, np.linspace(-15, 15, 16), 0.45),
    ],
)
def test_a_car_beside_the_sensor_is_no_ground(y, beams_deg, floor_m):
    """The lowest beam meets the road farther away: only bonnet and roof are flat there."""
    car = moved(vehicle("sedan", np.random.default_rng(3)), 1.0, y, math.pi)
    points = scan([*things(), car], (0.0, 0.0), 0, beams_deg)
    heights = height_above_ground(points, HEIGHT, GroundConfig())
    low, high = car.vertices.min(0) - 0.05, car.vertices.max(0) + 0.05
    of_car = ((points > low) & (points < high)).all(1) & (points[:, 2] > 0.55 - HEIGHT)
    of_car &= np.hypot(points[:, 0], points[:, 1]) > GroundConfig().nearest_m
    assert of_car.sum() > 500
    above = points[of_car, 2] + HEIGHT
    assert (heights[of_car] > 0).mean() > 0.99
    assert (np.abs(heights[of_car] - above) < floor_m).mean() > 0.99


def test_the_ground_stage_says_nothing_on_stdout(capfd):
    height_above_ground(road(np.random.default_rng(0)), 1.7, GroundConfig())
    assert capfd.readouterr().out == ""


def block(x, y, length=4.0, width=1.8, height=1.5, count=600, seed=0):
    """Points of a car-sized block on the ground, sensor 1.7 m above it."""
    rng = np.random.default_rng(seed)
    low, high = (x - length / 2, y - width / 2, -1.5), (x + length / 2, y + width / 2, height - 1.7)
    return rng.uniform(low, high, (count, 3)).astype(np.float32)


@pytest.mark.parametrize("away", [8.0, 30.0, 55.0])
def test_neighbours_are_apart_and_gaps_of_sparse_beams_are_bridged(away):
    config = ClusterConfig()
    reach = config.reach_m + config.reach_per_m * away
    cars = (block(away, 0.0), block(away, 1.8 + 1.5 * reach, seed=1))
    points = np.concatenate(cars)
    found = find_clusters(points, points[:, 2] + 1.7, config)
    assert sorted(map(len, found)) == [600, 600]
    halves = (block(away, 0.0, width=1.0), block(away, 1.0 + 0.5 * reach, width=1.0, seed=1))
    joined = np.concatenate(halves)
    assert len(find_clusters(joined, joined[:, 2] + 1.7, config)) == 1


@pytest.mark.parametrize("degrees", [0, 90, 135, 180, 210, 300])
def test_the_reach_is_the_same_all_around_the_sensor(degrees):
    config, away = ClusterConfig(), 12.0
    reach = config.reach_m + config.reach_per_m * away
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    turn = np.array(((c, s, 0), (-s, c, 0), (0, 0, 1)), np.float32)

    def count(gap, along):
        aside = np.roll((1.8 + gap, 0, 0), 0 if along else 1).astype(np.float32)
        cars = block(away, 0, 1.8), block(away, 0, 1.8, seed=1) + aside
        points = np.concatenate(cars) @ turn
        return len(find_clusters(points, points[:, 2] + 1.7, config))

    for along in (True, False):
        assert count(0.5 * reach, along) == 1
        assert count(1.6 * reach, along) == 2


def test_what_is_no_vehicle_by_size_or_place_is_no_cluster():
    config = ClusterConfig()
    for wrong in (
        block(10, 0, length=25.0, width=0.2, count=30000),  # a wall
        block(10, 0, length=0.5, width=0.5),  # a pole
        block(10, 0) + np.array((0, 0, 2.5), np.float32),  # a roof
        block(10, 0, height=0.45),  # a kerb
        block(10, 0, count=20),
    ):
        assert find_clusters(wrong, wrong[:, 2] + 1.7, config) == []


def test_a_low_ceiling_is_no_part_of_what_stands_under_it(tmp_path):
    """In a car park cars hung together through the ceiling: half of them were lost."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-9, 9, (2, 40000))
    ceiling = np.column_stack((x, y, rng.normal(0.2, 0.01, len(x)))).astype(np.float32)
    cars = np.concatenate([block(6.0, aside, seed=2) for aside in (-4.0, 0.0, 4.0)])
    scan = np.concatenate((road(rng), cars, ceiling))
    heights = np.concatenate((np.zeros(20000), cars[:, 2] + 1.7, ceiling[:, 2] + 1.7))
    drive = Drive.of("deck", ["0"], lambda _: Turn(scan))
    cutter = Cutter(drive, Mounting(1.7, 0.0, (0.0, 0.0, 1.0)), tmp_path, DriveConfig())
    assert cutter.cut(0, scan, heights, scan).counts.tolist() == [600] * 3


def test_extents_are_those_of_the_turned_rectangle():
    points = block(0, 0, count=4000)
    turn = np.array([[math.cos(0.5), -math.sin(0.5)], [math.sin(0.5), math.cos(0.5)]])
    length, width = extents(np.column_stack((points[:, :2] @ turn.T, points[:, 2])))
    assert length == pytest.approx(4.0, abs=0.1)
    assert width == pytest.approx(1.8, abs=0.1)


def seen(tick, *centres):
    rows = np.array([(*centre, 0.0) for centre in centres], float).reshape(-1, 3)
    return Seen(tick, rows, np.tile((4.0, 2.0, 1.5), (len(rows), 1)))


def test_two_that_pass_each_other_stay_two():
    scans = [seen(i, (i, 0.0), (10 - i, 2.5)) for i in range(11)]
    found = link(scans, LinkConfig())
    assert [one.frames for one in found] == [list(range(11))] * 2
    assert [one.rows for one in found] == [[0] * 11, [1] * 11]


def test_an_object_out_of_sight_goes_on_and_one_gone_too_long_does_not():
    config = LinkConfig()
    hidden = [
        seen(i) if 5 <= i < 5 + config.longest_gap - 1 else seen(i, (0.8 * i, 0)) for i in range(14)
    ]
    assert len(link(hidden, config)) == 1
    gone = [
        seen(i) if 5 <= i < 6 + config.longest_gap else seen(i, (0.8 * i, 0)) for i in range(20)
    ]
    assert len(link(gone, config)) == 2


def test_the_longer_one_was_out_of_sight_the_farther_off_it_may_be():
    config = LinkConfig()
    at = (0.0, config.gate_m + 2 * config.gate_per_tick_m)
    for unseen, count in ((0, 2), (3, 1)):
        scans = [*(seen(i, (0.0, 0.0)) for i in range(5)), seen(5 + unseen, at)]
        assert len(link(scans, config)) == count


def test_a_fast_one_is_followed_from_its_first_scan_on():
    scans = [seen(i, (60.0 - 2.7 * i, 3.0), (5.0, -3.0)) for i in range(12)]  # 97 km/h
    assert [one.frames for one in link(scans, LinkConfig())] == [list(range(12))] * 2


def test_of_few_scans_a_second_what_drives_and_what_stands_are_followed():
    """12 m/s at 2 Hz; the one that stands has a neighbour that is seen at times."""
    flicker = [((13.0, -3.0),) if i % 3 == 1 else () for i in range(8)]
    scans = [seen(i, (60.0 - 6.0 * i, 3.0), (9.0, -3.0), *flicker[i]) for i in range(8)]
    assert len(link(scans, LinkConfig())) > 3
    found = link(scans, LinkConfig(), LinkConfig().wider(0.5))
    assert [one.frames for one in found] == [list(range(8))] * 2 + [[1, 4, 7]]
    assert [one.rows for one in found[:2]] == [[0] * 8, [1] * 8]


def test_where_the_sensor_is_fast_so_is_what_goes_along_and_comes_towards_it():
    """36 m/s at 10 Hz; where it is slow no gate is wider."""
    scans = [seen(i, (20.0 + 3.6 * i, 3.0), (90.0 - 3.6 * i, 7.0)) for i in range(12)]
    config = LinkConfig()
    assert len(link(scans, config)) > 2
    found = link(scans, config, config.wider(0.1, step_m=3.6))
    assert [one.frames for one in found] == [list(range(12))] * 2
    assert config.wider(0.1, step_m=2.0) == config.wider(None, step_m=2.0) == 1.0


def test_a_fast_one_is_followed_where_steps_are_uneven():
    """At 0.08 and 0.12 s in turn by whole scans all above 18 m/s were lost."""
    ticks = np.cumsum([0.0, *(0.8, 1.2) * 20])
    size = np.array(((4.5, 1.8, 1.5),))
    seen = [Seen(float(tick), np.array(((2.4 * tick, 0.0, 0.0),)), size) for tick in ticks]
    (found,) = link(seen, LinkConfig())
    assert found.velocity[0] == pytest.approx(2.4)


def test_an_object_of_which_less_is_seen_stays_the_same():
    """A lorry of 8 m, and then its rear alone: its middle jumps, its rear does not."""
    lengths = [8.0] * 5 + [0.4] * 5
    scans = [
        Seen(i, np.array([(length / 2, 0.0, 0.0)]), np.array([(length, 2.5, 3.0)]))
        for i, length in enumerate(lengths)
    ]
    (found,) = link(scans, LinkConfig())
    assert found.frames == list(range(10))
    assert found.velocity == pytest.approx(np.zeros(3))


def test_pieces_of_one_scan_are_one_cloud():
    left = Sightings("0", (3, 4), ((0,), (2,)), (40, 50))
    right = Sightings("1", (4, 5), ((5,), (1,)), (60, 70))
    both = merged([left, right])
    assert both == Sightings("0+1", (3, 4, 5), ((0,), (2, 5), (1,)), (40, 110, 70), ("0", "1"))


def test_a_jump_is_counted_and_a_missing_scan_is_none():
    steady = [(0.8 * i, 0.0, 0.0) for i in (0, 1, 2, 5, 6, 7)]
    config = TrajectoryConfig()

    def poses(places):
        at = torch.tensor(places, dtype=torch.float64)
        return SE3(torch.eye(3, dtype=torch.float64).expand(len(at), 3, 3), at)

    assert list(jumps(poses(steady), (0, 1, 2, 5, 6, 7), config)) == []
    assert usual_step_m(poses(steady), (0, 1, 2, 5, 6, 7)) == pytest.approx(0.8)
    assert usual_step_m(poses(steady[:1]), (0,)) == 0.0
    uneven = tuple(np.cumsum((0.0, *(0.6, 1.4) * 5)).tolist())
    assert list(jumps(poses([(2.7 * tick, 0.0, 0.0) for tick in uneven]), uneven, config)) == []
    leap = [*steady[:4], *((x + 30.0, y, z) for x, y, z in steady[4:])]
    assert 4 in jumps(poses(leap), (0, 1, 2, 5, 6, 7), config)
