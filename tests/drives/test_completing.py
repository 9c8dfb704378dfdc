# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From tracks to vehicles, stage by stage."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.drives.cuts import write_cut
from tests.drives.objects import completed, still

from wildshape.drives.completing.boxes import moves, smooth
from wildshape.drives.completing.cluster_association import associate
from wildshape.drives.completing.completion import fullest_of_parts, keyframes, order_of_looks
from wildshape.drives.completing.level_frame import on_ground, on_ground_of_each
from wildshape.drives.completing.merging import Places
from wildshape.drives.completing.surroundings import crowded
from wildshape.drives.completing.vehicles import (
    judge,
    stated,
    vehicle_confidence,
    vehicle_sized,
)
from wildshape.drives.config import (
    BoxConfig,
    CompletionConfig,
    DriveConfig,
    MergeConfig,
    SurroundingsConfig,
    VehicleConfig,
)
from wildshape.drives.tracking.sightings import Sightings


def test_the_fullest_scan_of_each_part_is_completed():
    points = (10, 90, 70, 20, 80, 30, 5, 6, 7)
    one = Sightings("a", tuple(range(9)), ((0,),) * 9, points)
    assert fullest_of_parts(one, 3).frames == (1, 4, 8)
    assert fullest_of_parts(one, 3, fewest_points=60).frames == (1, 4)
    assert fullest_of_parts(one, 3, fewest_points=1000).frames == (1,)
    assert keyframes(one, CompletionConfig(scans=4, ticks=4, fewest_points=0)).frames == (1, 4, 8)
    assert order_of_looks(one, 3) == [1, 4, 8, 0, 2, 3, 5, 6, 7]
    assert order_of_looks(one.part([3, 4]), 3) == [1, 0]


def test_a_moving_vehicle_goes_straight_on_between_its_completed_scans():
    frames = (0, 4, 8, 12)
    boxes = [(0.5 * f, -0.2 * f, 0.0, math.atan2(-0.2, 0.5)) for f in frames]
    way = smooth(completed(boxes, frames), still(13), BoxConfig())
    assert way.moving
    at = np.arange(13)
    expected = np.column_stack((0.5 * at, -0.2 * at, 0 * at, np.full(13, math.atan2(-0.2, 0.5))))
    assert way.boxes == pytest.approx(expected, abs=1e-9)


def test_a_standing_vehicle_has_one_box_whatever_one_scan_says():
    boxes = [(5.0, 1.0, 0.0, 3.1), (5.1, 1.0, 0.0, -3.1), (9.0, 7.0, 0.0, 0.0), (5.0, 1.1, 0, 3.14)]
    way = smooth(completed(boxes), still(4), BoxConfig())
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


def stop_and_go(ticks):
    """Metres: 10 m/s, from the second second on it brakes with 2.5 m/s^2, then it stands."""
    braking = np.clip(ticks / 10 - 2.0, 0.0, 4.0)
    return 10 * np.minimum(ticks / 10, 2.0) + 10 * braking - 1.25 * braking**2


def test_who_stands_most_of_the_time_has_moved_and_one_jump_is_no_motion():
    ticks = np.arange(0.0, 600.0, 4.0)
    boxes = np.zeros((len(ticks), 4))
    boxes[:, 0] = stop_and_go(ticks)
    assert moves(ticks, boxes, BoxConfig())
    boxes[:, 0] = 2.0 * (ticks > 100)
    assert not moves(ticks, boxes, BoxConfig())


def test_one_that_stands_may_jump_once_in_few_scans():
    """As where a parked car is passed: its far end is seen at last."""
    ticks = np.array((0.0, 4.0, 7.0, 13.0, 14.0))
    boxes = np.zeros((5, 4))
    boxes[:, 3] = np.arctan2(0.6, 1.2)
    boxes[ticks > 10, :2] = 1.2, 0.6
    assert not moves(ticks, boxes, BoxConfig())
    assert not moves(ticks[2:], boxes[2:], BoxConfig())
    boxes[:, :2] = np.outer(ticks, (0.12, 0.06))
    assert moves(ticks, boxes, BoxConfig())


@pytest.mark.parametrize("bend", [0.0, 0.02])
def test_a_vehicle_drives_ahead_or_back_and_never_aside(bend):
    """What stands in a row slips aside, to its neighbour, where little of it is seen."""
    ticks = np.arange(0.0, 40.0, 4.0)
    course = bend * ticks
    steps = np.column_stack((np.cos(course), np.sin(course), 0 * ticks, 0 * ticks))
    places = 0.3 * np.cumsum(steps, axis=0)
    for off, driven in ((0.0, True), (math.pi, True), (math.pi / 2, False), (-math.pi / 2, False)):
        looking = np.outer(course + off, (0.0, 0.0, 0.0, 1.0))
        assert moves(ticks, places + looking, BoxConfig()) == driven


def test_boxes_follow_a_vehicle_that_brakes_between_scans_a_second_apart():
    frames = tuple(range(0, 91, 10))
    boxes = [(float(stop_and_go(np.array(f))), 0.0, 0.0, 0.0) for f in frames]
    way = smooth(completed(boxes, frames), still(91), BoxConfig())
    assert np.abs(way.boxes[:, 0] - stop_and_go(np.arange(91))).max() < 0.25


def test_poses_that_slip_beside_the_way_of_a_vehicle_do_not_move_it():
    frames = tuple(range(0, 61, 4))
    turned = np.arange(61) / 100
    bend = 100 * np.column_stack((np.sin(turned), 1 - np.cos(turned), 0 * turned, turned / 100))
    boxes = bend[list(frames)]
    for row in (6, 7, 12):
        boxes[row] = (boxes[row][0] - 2.0, boxes[row][1] + 1.5, 0.0, 1.2)
    way = smooth(completed(boxes, frames), still(61), BoxConfig())
    assert np.abs(way.boxes - bend).max() < 0.05


def test_a_doubtful_vehicle_is_none_where_a_wall_goes_on_beyond_its_box():
    rng = np.random.default_rng(0)
    car = rng.uniform((-2.0, -0.9, -0.7), (2.0, 0.9, 0.7), (400, 3)).astype(np.float32)
    wall = rng.uniform((-6.0, -0.9, -0.7), (6.0, -0.8, 2.0), (1200, 3)).astype(np.float32)
    ground = rng.uniform((-6.0, -6.0, -0.8), (6.0, 6.0, -0.7), (900, 3)).astype(np.float32)
    one = completed([(0.0, 0.0, 0.0, 0.0)] * 2)

    def names(*parts):
        scan = np.concatenate(parts)
        return crowded(lambda _: scan, [one], still(2), SurroundingsConfig())

    assert names(car, ground) == set()
    assert names(car, ground, wall) == {"a"}


def test_points_of_a_lorry_are_as_large_as_a_vehicle_and_those_of_a_wall_are_not():
    rng = np.random.default_rng(0)
    lorry = rng.uniform((-4.4, -1.2, 0.0), (4.4, 1.2, 3.0), (400, 3))
    wall = rng.uniform((-4.4, -0.1, 0.0), (4.4, 0.1, 3.0), (400, 3))
    assert vehicle_sized([lorry, lorry, wall], VehicleConfig())
    assert not vehicle_sized([lorry, wall, wall], VehicleConfig())


def places():
    return Places(still(100), MergeConfig(), BoxConfig())


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


def test_the_weights_own_probability_goes_before_what_was_added_up():
    here = [(0.0, 0.0, 0.0, 0.0)]
    likely = replace(completed(here, name="likely", cost=0.5), p_kind=0.6)
    unlikely = replace(completed(here, frames=(90,), name="unlikely"), p_kind=0.2)
    other = completed([(30.0, 0.0, 0.0, 0.0)], name="other")
    said = {one.name: one for one in judge([likely, unlikely, other], places(), VehicleConfig())}
    assert (said["likely"].confidence, said["likely"].reasons) == (0.6, ())
    assert said["unlikely"].reasons == ("unlikely",)
    sure = {name: one.confidence for name, one in said.items()}
    assert stated(likely, sure) == likely.confidence == 0.5  # the product, of the completions
    assert stated(other, sure) == sure["other"] != 0.5


def test_what_is_as_high_as_a_house_is_a_vehicle_only_if_that_is_sure():
    config, at = VehicleConfig(), [(0.0, 0.0, 0.0, 0.0)]

    def reasons(height, p_kind):
        one = replace(completed(at, size=(8.0, 2.5, height)), p_kind=p_kind)
        (said,) = judge([one], places(), config)
        return said.reasons

    assert reasons(3.5, 0.5) == reasons(3.9, 0.8) == ()
    assert reasons(3.7, 0.6) == reasons(4.1, 0.99) == ("height",)


def test_tracks_of_one_shape_in_one_place_are_put_together():
    here, there = [(0.0, 0.0, 0.0, 0.0)], [(0.4, 0.1, 0.0, 0.0)]
    objects = [
        completed(here, frames=(0,), name="0"),
        completed(there, frames=(90,), name="1"),  # long hidden, and standing
        completed([(9.0, 0.0, 0.0, 0.0)], frames=(6,), name="2"),
    ]
    (found,) = places().fragments(objects)
    assert (found.name, found.frames, found.parts) == ("0+1", (0, 90), ("0", "1"))
    whole = completed(here, frames=(0,), name="0+1", parts=("0", "1"))
    said = judge([*objects, whole], places(), VehicleConfig())
    assert {one.name for one in said if not one.reasons} == {"0+1", "2"}


def test_a_moving_vehicle_is_looked_for_where_its_way_leads():
    def driving(frames, x=0.0, y=0.0, **other):
        return completed([(x + frame, y, 0.0, 0.0) for frame in frames], frames=frames, **other)

    first = driving((0, 4, 8, 12, 16), name="0")
    beside = completed([(10.0, 3.0, 0.0, 0.0)], frames=(12,), name="parked")
    passed = completed([(10.0, 0.0, 0.0, 0.0)], frames=(40,), name="stands there later")
    hidden = driving((26, 30, 34), name="1")
    behind = driving((26, 30, 34), x=-9.0, name="2")
    (found,) = places().fragments([first, beside, hidden, behind, passed])
    assert found.name == "0+1"


def test_vehicles_beside_each_other_are_not_joined_by_what_lies_between():
    def at(x, name, length=4.0):
        return completed([(x, 0.0, 0.0, 0.0)], name=name, size=(length, 1.8, 1.5))

    first, between, second = at(0.0, "0"), at(2.3, "1"), at(5.0, "2")
    (found,) = places().fragments([first, between, second])
    assert found.name == "0+1"


def write_grounds(folder, grounds):
    """Cuts of one cluster each, and the ground's z under it."""
    for frame, ground in enumerate(grounds):
        write_cut(folder, frame, [np.zeros((4, 3))], 4, [(0.0, 0.0, ground)])


def test_boxes_reach_down_to_the_ground_under_the_clusters_that_are_left(tmp_path):
    write_grounds(tmp_path, (-1.0, -1.0, 9.0))
    one = completed([(0.0, 0.0, -0.1, 0.0)] * 3)
    on_two = replace(one, seen=one.seen.part([0, 1]))
    found = on_ground(on_two, tmp_path, still(3), BoxConfig())
    assert found.size == pytest.approx((4.0, 1.8, 1.65))
    assert found.boxes[:, 2] == pytest.approx([-0.175] * 3)
    assert found.raised_m == pytest.approx(-0.075)
    unknown = replace(one, boxes=np.full_like(one.boxes, math.nan))
    assert on_ground(unknown, tmp_path, still(3), BoxConfig()) is unknown
    nowhere = replace(one, seen=one.seen.part([]))
    assert on_ground(nowhere, tmp_path, still(3), BoxConfig()) is nowhere
    lifted = replace(one, boxes=np.add(one.boxes, (0.0, 0.0, 1.0, 0.0)))
    assert on_ground(lifted, tmp_path, still(3), BoxConfig()) is lifted


def test_boxes_follow_the_ground_that_frames_show_where_poses_are_wrong(tmp_path):
    ground = -1 + 0.01 * np.arange(12)
    seen = ground.copy()
    seen[6] = 1.0  # a part of a lorry
    write_grounds(tmp_path, seen)
    frames, shown = tuple(range(12)), np.tile((9.0, 2.0, -0.25, 0.3), (12, 1))
    one = completed(shown, frames=frames)

    def floors(one, shown=shown):
        found = on_ground_of_each(frames, shown, one, tmp_path, still(12), BoxConfig())
        assert (found[:, (0, 1, 3)] == shown[:, (0, 1, 3)]).all()
        return found[:, 2] - one.size[2] / 2

    assert floors(one) == pytest.approx(ground, abs=0.011)
    sinking = np.outer(np.arange(12), (0.0, 0.0, 0.1, 0.0))
    assert floors(one, shown - sinking) == pytest.approx(ground, abs=0.12)
    partly = replace(one, seen=one.seen.part([0, 1, 2, 9, 10, 11]))
    assert floors(partly) == pytest.approx(ground, abs=0.021)
    hidden = replace(one, seen=one.seen.part([]))
    assert (floors(hidden) == -1).all()
    on_a_bridge = np.add(shown, (0.0, 0.0, 5.0, 0.0))
    assert (floors(one, on_a_bridge) == 4).all()
    uphill = np.outer(np.arange(12), (0.0, 0.0, 0.2, 0.0))
    write_grounds(tmp_path, seen + uphill[:, 2])
    assert floors(one, shown + uphill) == pytest.approx(ground + uphill[:, 2], abs=0.011)


def test_clusters_in_the_box_of_a_vehicle_are_its_own(tmp_path):
    rng = np.random.default_rng(0)

    def piece(x, y):
        return rng.uniform((x - 0.3, y - 0.3, -0.5), (x + 0.3, y + 0.3, 0.5), (20, 3))

    front, rear, beside = piece(1.5, 0.0), piece(-1.5, 0.0), piece(0.0, 1.4)
    for frame in range(3):
        write_cut(tmp_path, frame, (beside, front, rear), 90)
    at = [(0.0, 0.0, 0.0, 0.0)]
    whole = replace(completed(at, name="whole"), seen=Sightings("whole", (0,), ((1,),), (20,)))
    again = replace(completed(at, name="again"), seen=Sightings("again", (2,), ((2,),), (20,)))
    found = associate([whole, again], tmp_path, still(3), DriveConfig())
    assert found.parts == {"again": "part_of_whole"}
    (only,) = found.vehicles
    assert only.seen.frames == (0, 1, 2)
    assert only.seen.rows == ((1, 2),) * 3
    assert only.seen.points == (40,) * 3


def test_the_document_names_what_is_not_found():
    page = (Path(__file__).parents[2] / "docs/drive.md").read_text("utf-8")
    (said,) = re.findall(r"Not found are:\n\n(?:- .*\n)+", page)
    rule = DriveConfig()
    sizes = rule.clusters.range_m, rule.vehicles.length_m[1], rule.vehicles.tall_m
    assert all(f" {size:.0f} m" in said for size in sizes), said
    assert f"never seen with {rule.vehicles.fewest_points} points" in said
    assert rule.tracks.fewest_scans == 4
    assert "fewer than four scans" in said
