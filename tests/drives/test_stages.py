# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Each stage of a drive on its own."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from wildshape.drives.completing.boxes import moves, smooth
from wildshape.drives.completing.claims import claim
from wildshape.drives.completing.completion import fullest_of_parts, keyframes
from wildshape.drives.completing.merging import Places
from wildshape.drives.completing.placing import Completed
from wildshape.drives.completing.vehicles import judge, vehicle_confidence
from wildshape.drives.config import (
    BoxConfig,
    ClusterConfig,
    CompletionConfig,
    DriveConfig,
    GroundConfig,
    LinkConfig,
    MergeConfig,
    MountingConfig,
    TrajectoryConfig,
    VehicleConfig,
)
from wildshape.drives.tracking.clusters import connected, extents, find_clusters
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import Mounting, ground_plane
from wildshape.drives.tracking.segmentation import cut_file
from wildshape.drives.tracking.sightings import Sightings, merged
from wildshape.drives.tracking.tracks import Seen, link
from wildshape.drives.tracking.trajectory import jumps
from wildshape.geometry.transforms.se3 import SE3


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


def test_the_ground_stage_says_nothing_on_stdout(capfd):
    height_above_ground(road(np.random.default_rng(0)), 1.7, GroundConfig())
    assert capfd.readouterr().out == ""


def test_connected_is_the_components_of_all_pairs():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 6, (300, 3))
    found = connected(points, 0.7, thin=1e-3)
    near = np.linalg.norm(points[:, None] - points, axis=-1) <= 0.7
    label = np.arange(300)
    for _ in range(300):
        label = np.where(near, label, 300).min(1)
    expected = sorted((frozenset(np.flatnonzero(label == k)) for k in set(label)), key=sorted)
    assert sorted((frozenset(part) for part in found), key=sorted) == expected


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


def test_the_fullest_scan_of_each_part_is_completed():
    points = (10, 90, 70, 20, 80, 30, 5, 6, 7)
    one = Sightings("a", tuple(range(9)), ((0,),) * 9, points)
    assert fullest_of_parts(one, 3).frames == (1, 4, 8)
    assert fullest_of_parts(one, 3, fewest_points=60).frames == (1, 4)
    assert fullest_of_parts(one, 3, fewest_points=1000).frames == (1,)
    assert keyframes(one, CompletionConfig(scans=4, ticks=4, fewest_points=0)).frames == (1, 4, 8)


def completed(boxes, frames=None, name="a", size=(4.0, 1.8, 1.5), cost=0.1, parts=1):
    frames = tuple(range(len(boxes))) if frames is None else frames
    whole = tuple(range(frames[0], frames[-1] + 1))
    sightings = Sightings(name, whole, ((0,),) * len(whole), (200,) * len(whole), parts)
    return Completed(sightings, frames, np.array(boxes, float), size, cost, 0.5)


def test_a_moving_vehicle_goes_straight_on_between_its_completed_scans():
    frames = (0, 4, 8, 12)
    boxes = [(0.5 * f, -0.2 * f, 0.0, math.atan2(-0.2, 0.5)) for f in frames]
    way = smooth(completed(boxes, frames), tuple(range(13)), BoxConfig())
    assert way.moving
    at = np.arange(13)
    expected = np.column_stack((0.5 * at, -0.2 * at, 0 * at, np.full(13, math.atan2(-0.2, 0.5))))
    assert way.boxes == pytest.approx(expected, abs=1e-9)


def test_the_front_is_where_a_vehicle_drives_to():
    boxes = [(0.5 * f, 0.0, 0.0, math.pi if f < 3 else 0.0) for f in range(6)]
    way = smooth(completed(boxes), tuple(range(6)), BoxConfig())
    assert np.abs(way.boxes[:, 3]).max() < 1e-6


def test_a_standing_vehicle_has_one_box_whatever_one_scan_says():
    boxes = [(5.0, 1.0, 0.0, 3.1), (5.1, 1.0, 0.0, -3.1), (9.0, 7.0, 0.0, 0.0), (5.0, 1.1, 0, 3.14)]
    way = smooth(completed(boxes), tuple(range(4)), BoxConfig())
    assert not way.moving
    assert (way.boxes == way.boxes[0]).all()
    assert way.boxes[0, :2] == pytest.approx((5.05, 1.0), abs=0.06)
    assert abs(math.remainder(way.boxes[0, 3] - math.pi, 2 * math.pi)) < 0.05


def test_little_or_slow_motion_is_none():
    config = BoxConfig()
    ticks = np.arange(60.0)
    still = np.zeros((60, 4))
    assert not moves(ticks, still, config)
    creeping = still + np.outer(ticks, (0.03, 0, 0, 0))
    assert not moves(ticks, creeping, config)
    assert moves(ticks, still + np.outer(ticks, (0.1, 0, 0, 0)), config)


def places():
    return Places(tuple(range(100)), MergeConfig(), BoxConfig())


def test_vehicles_are_told_by_cost_and_size_and_counted_once():
    at = [(0.0, 0.0, 0.0, 0.0)]
    objects = [
        completed(at, name="good", cost=0.08),
        completed([(0.5, 0.1, 0.0, 0.1)], name="again", cost=0.12),
        completed([(9.0, 0.0, 0.0, 0.0)], name="costly", cost=0.5),
        completed([(20.0, 0.0, 0.0, 0.0)], name="high", size=(4.0, 1.8, 5.0)),
        completed([(0.5, 0.1, 0.0, 0.1)], frames=(90,), name="later"),
    ]
    said = {one.name: one.reasons for one in judge(objects, places(), VehicleConfig())}
    assert said == {
        "good": (),
        "again": ("same_place_as_good",),
        "costly": ("unlikely",),
        "high": ("unlikely", "height"),
        "later": ("same_place_as_good",),
    }


def test_less_cost_usual_size_and_more_scans_speak_for_a_vehicle():
    config = VehicleConfig()
    at = [(0.0, 0.0, 0.0, 0.0)] * 8

    def sure(**other):
        return vehicle_confidence(completed(at, **other), config)

    assert 0.0 < sure(cost=0.3) < sure(cost=0.2) < sure(cost=0.1) < 1.0
    assert sure(size=(4.3, 1.9, 1.0)) < sure() > sure(size=(4.3, 2.9, 1.5))
    assert sure(size=(7.0, 2.5, 3.0)) > 0.5  # a lorry
    assert sure(frames=tuple(range(0, 32, 4))) > sure()
    # What is known in nats: the cost's own scale.
    nats = [math.log(p / (1 - p)) for p in (sure(cost=0.1), sure(cost=0.1 + config.cost_scale_m))]
    assert nats[0] - nats[1] == pytest.approx(1.0)


def test_tracks_of_one_shape_in_one_place_are_put_together():
    here, there = [(0.0, 0.0, 0.0, 0.0)], [(0.4, 0.1, 0.0, 0.0)]
    objects = [
        completed(here, frames=(0,), name="0"),
        completed(there, frames=(90,), name="1"),  # long hidden, and standing
        completed([(9.0, 0.0, 0.0, 0.0)], frames=(6,), name="2"),
    ]
    (found,) = places().fragments(objects)
    assert (found.name, found.frames, found.parts) == ("0-1", (0, 90), 2)
    whole = completed(here, frames=(0,), name="0-1", parts=2)
    said = judge([*objects, whole], places(), VehicleConfig())
    assert {one.name for one in said if not one.reasons} == {"0-1", "2"}


def test_a_moving_vehicle_is_looked_for_where_its_way_leads():
    def driving(frames, x=0.0, y=0.0, **other):
        return completed([(x + frame, y, 0.0, 0.0) for frame in frames], frames=frames, **other)

    first = driving((0, 4, 8, 12, 16), name="0")
    beside = completed([(10.0, 3.0, 0.0, 0.0)], frames=(12,), name="parked")
    passed = completed([(10.0, 0.0, 0.0, 0.0)], frames=(40,), name="stands there later")
    hidden = driving((26, 30, 34), name="1")
    behind = driving((26, 30, 34), x=-9.0, name="2")
    (found,) = places().fragments([first, beside, hidden, behind, passed])
    assert found.name == "0-1"


def test_vehicles_beside_each_other_are_not_joined_by_what_lies_between():
    def at(x, name, length=4.0):
        return completed([(x, 0.0, 0.0, 0.0)], name=name, size=(length, 1.8, 1.5))

    first, between, second = at(0.0, "0"), at(2.3, "1"), at(5.0, "2")
    (found,) = places().fragments([first, between, second])
    assert found.name == "0-1"


def test_clusters_in_the_box_of_a_vehicle_are_its_own(tmp_path):
    rng = np.random.default_rng(0)

    def piece(x, y):
        return rng.uniform((x - 0.3, y - 0.3, -0.5), (x + 0.3, y + 0.3, 0.5), (20, 3))

    front, rear, beside = piece(1.5, 0.0), piece(-1.5, 0.0), piece(0.0, 1.4)
    for frame in range(3):
        counts = np.array([20, 20, 20])
        points = np.concatenate((beside, front, rear)).astype(np.float32)
        with cut_file(tmp_path, frame).open("wb") as file:
            np.savez(file, points=points, counts=counts, scanned=90, tracks=np.array([], str))
    at = [(0.0, 0.0, 0.0, 0.0)]
    whole = replace(completed(at, name="whole"), seen=Sightings("whole", (0,), ((1,),), (20,)))
    again = replace(completed(at, name="again"), seen=Sightings("again", (2,), ((2,),), (20,)))
    still = SE3(torch.eye(3).double().expand(3, 3, 3), torch.zeros(3, 3).double())
    found = claim([whole, again], tmp_path, still, (0, 1, 2), DriveConfig())
    assert found.parts == {"again": "whole"}
    (only,) = found.vehicles
    assert only.seen.frames == (0, 1, 2)
    assert only.seen.rows == ((1, 2),) * 3
    assert only.seen.points == (40,) * 3


def test_pieces_of_one_scan_are_one_cloud():
    left = Sightings("0", (3, 4), ((0,), (2,)), (40, 50))
    right = Sightings("1", (4, 5), ((5,), (1,)), (60, 70))
    both = merged([left, right])
    assert both == Sightings("0-1", (3, 4, 5), ((0,), (2, 5), (1,)), (40, 110, 70), 2)


def test_a_jump_is_counted_and_a_missing_scan_is_none():
    steady = [(0.8 * i, 0.0, 0.0) for i in (0, 1, 2, 5, 6, 7)]
    config = TrajectoryConfig()

    def poses(places):
        at = torch.tensor(places, dtype=torch.float64)
        return SE3(torch.eye(3, dtype=torch.float64).expand(len(at), 3, 3), at)

    assert list(jumps(poses(steady), (0, 1, 2, 5, 6, 7), config)) == []
    leap = [*steady[:4], *((x + 30.0, y, z) for x, y, z in steady[4:])]
    assert 4 in jumps(poses(leap), (0, 1, 2, 5, 6, 7), config)


@given(st.floats(-math.pi, math.pi), st.floats(-2, 2), st.floats(-2, 2))
def test_the_footprint_of_upright_boxes_overlaps_as_the_boxes_do(yaw, x, y):
    from wildshape.geometry.box import FittedBox, box_iou
    from wildshape.geometry.footprint import footprint_iou
    from wildshape.geometry.transforms.rotation import rotation_z

    size, other = (4.0, 1.8, 1.0), (3.0, 1.5, 1.0)
    eye = torch.eye(3, dtype=torch.float64)
    a = FittedBox(torch.zeros(3).double(), torch.tensor(size).double(), eye)
    turn = rotation_z(torch.tensor(yaw, dtype=torch.float64))
    b = FittedBox(torch.tensor((x, y, 0.0)).double(), torch.tensor(other).double(), turn)
    found = footprint_iou(np.zeros(4), size, np.array((x, y, 0.0, yaw)), other)
    assert found == pytest.approx(box_iou(a, b), abs=1e-6)
