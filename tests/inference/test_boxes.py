# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes hold the body that shape and scans show; mirrors and stray points are left outside."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tests.method.small import settings

from wildshape.geometry.box import FittedBox
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.boxes import _nth_largest, box_seen, carried, fit_to_scans
from wildshape.inference.config import BoxConfig

SIZE = torch.tensor((4.0, 1.8, 1.5), dtype=torch.float64)


def surface(count=3000, seed=0, size=SIZE):
    """Points on the six sides of a box around the origin."""
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(count, 3, generator=generator, dtype=torch.float64) - 0.5
    side = torch.arange(count) % 6
    points[torch.arange(count), side // 2] = (side % 2 - 0.5).double()
    return points * size


def about_y(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return torch.tensor(((c, 0, s), (0, 1, 0), (-s, 0, c)), dtype=torch.float64)


def test_a_shape_alone_has_its_own_box():
    fitted = fit_to_scans(surface(), [], mirror=True)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.02, rtol=0)
    torch.testing.assert_close(fitted.rotation, torch.eye(3).double())


def test_a_box_is_carried_with_every_point_of_it():
    """Of a levelled shape in a tilted sensor's frame; x, y, z as shares of the size."""
    turn = rotation_from_quaternion(torch.tensor((0.8, -0.3, 0.4, 0.6), dtype=torch.float64))
    T = SE3(turn, torch.tensor((9.0, -4.0, -1.0), dtype=torch.float64))
    fitted = FittedBox(torch.tensor((0.3, -0.2, 0.1), dtype=torch.float64), SIZE, about_y(20.0))
    within = torch.tensor(((0.5, 0.5, 0.5), (0.5, -0.5, 0.1), (-0.2, 0.3, -0.5))).double() * SIZE
    box = carried(fitted, T)
    R_sensor_box = rotation_from_quaternion(torch.tensor(box.quaternion_wxyz).double())
    found = within @ R_sensor_box.T + torch.tensor(box.centre).double()
    expected = T.apply(within @ fitted.rotation.T + fitted.centre)
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.tensor(box.size).double(), SIZE)


def test_what_little_sticks_out_is_no_part_of_a_body():
    mirrors = torch.tensor([[0.8, side * y, 0.2] for side in (-1, 1) for y in (0.95, 1.0, 1.05)])
    shape = torch.cat((surface(), mirrors.repeat(4, 1).double()))
    scan = torch.cat((surface(300, seed=1), mirrors.double()))
    fitted = fit_to_scans(shape, [scan], mirror=True)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.02, rtol=0)
    whole = fit_to_scans(shape, [scan], mirror=True, body=False)
    assert whole.size.tolist() == pytest.approx((4.0, 2.1, 1.5), abs=0.02)
    seen_alone = fit_to_scans(surface(), [scan], mirror=True, body=False)
    assert seen_alone.size.tolist() == pytest.approx((4.0, 2.1, 1.5), abs=0.02)


def test_where_a_scan_ends_beyond_the_shape_a_body_ends_with_it_on_the_side_seen_alone():
    wide = surface(300, seed=1) * torch.tensor((1.0, 1.1, 1.0), dtype=torch.float64)
    left, right = wide[wide[:, 1] > 0], wide[wide[:, 1] < 0]
    for side, towards in ((left, 0.045), (right, -0.045)):
        fitted = fit_to_scans(surface(), [side], mirror=True)
        assert fitted.size.tolist() == pytest.approx((4.0, 1.89, 1.5), abs=0.02)
        assert fitted.centre.tolist() == pytest.approx((0, towards, 0), abs=0.02)
        whole = fit_to_scans(surface(), [side], mirror=True, body=False)
        assert whole.size.tolist() == pytest.approx((4.0, 1.98, 1.5), abs=0.02)
        assert whole.centre.tolist() == pytest.approx((0, 0, 0), abs=0.02)
    one_sided = fit_to_scans(surface(), [left], mirror=False)
    assert float(one_sided.size[1]) == pytest.approx(1.89, abs=0.05)


@pytest.mark.parametrize("front", [True, False])
def test_an_end_that_scans_came_near_without_seeing_it_is_drawn_back(front):
    ends = torch.tensor((1.0 if front else -1.0, 1.0, 1.0), dtype=torch.float64)
    tail = surface(90, seed=2) * torch.tensor((0.1, 1.0, 1.0), dtype=torch.float64)
    tail[:, 0] = 2.0 + 0.4 * torch.arange(1, 91) / 90  # 3 % of the shape, spread over 0.4 m
    shape = torch.cat((surface(), tail)) * ends
    scan = surface(3000, seed=1) * ends
    before, far_before = (scan[scan[:, 0] * ends[0] < x] for x in (1.6, 0.5))
    own, drawn_back = 2.4 - 0.4 * 30 / 90, 2.4 - 0.4 * 61 / 90
    alone = ([before], drawn_back), ([scan], 2.2), ([far_before], own), ([scan[:0]], own)
    one_of_four, two_of_four = [before, scan, before, before], [scan, before, before, scan]
    for seen, wanted in (*alone, (one_of_four, drawn_back), (two_of_four, 2.2)):
        fitted = fit_to_scans(shape, seen, mirror=True)
        end = float(fitted.centre[0]) * float(ends[0]) + float(fitted.size[0]) / 2
        assert end == pytest.approx(wanted, abs=0.02)
        small = fit_to_scans(shape / 10, [one / 10 for one in seen], mirror=True, unit=0.1)
        torch.testing.assert_close(small.size, fitted.size / 10)
    whole = fit_to_scans(shape, [before], mirror=True, body=False)
    assert float(whole.size[0]) == pytest.approx(4.4, abs=0.03)


def test_an_end_is_never_drawn_beyond_where_it_was():
    """By a larger `shape_share` than `hidden_share` it was."""
    config = BoxConfig(shape_share=0.3)
    shape = torch.linspace(-2, 2, 3000, dtype=torch.float64)[:, None] * torch.ones(3).double()
    alone = fit_to_scans(shape, [], mirror=True, config=config)
    fitted = fit_to_scans(shape, [shape[shape[:, 0].abs() < 0.5]], mirror=True, config=config)
    torch.testing.assert_close(fitted.size, alone.size)


def test_ground_left_around_the_wheels_is_no_end_or_side():
    ring = surface(600, seed=4) * torch.tensor((1.12, 1.2, 0.0), dtype=torch.float64)
    ring = ring[(ring[:, 0].abs() > 2.0) | (ring[:, 1].abs() > 0.9)] - torch.tensor((0, 0, 0.7))
    scan = torch.cat((surface(600, seed=1), ring))
    fitted = fit_to_scans(surface(), [scan], mirror=True)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.02, rtol=0)
    nothing_else = fit_to_scans(surface(), [ring], mirror=True)
    torch.testing.assert_close(nothing_else.size, fit_to_scans(surface(), [], mirror=True).size)
    whole = fit_to_scans(surface(), [scan], mirror=True, body=False)
    assert whole.size.tolist() == pytest.approx((4.48, 2.16, 1.5), abs=0.05)


def test_a_box_reaches_down_to_a_bottom_that_is_known_and_never_ends_above_its_shape():
    for at, height in ((-0.85, 1.6), (-0.6, 1.5)):
        bottom = torch.tensor((0.3, 0.0, at), dtype=torch.float64)
        fitted = fit_to_scans(surface(), [], mirror=True, bottom=bottom)
        assert fitted.size.tolist() == pytest.approx((4.0, 1.8, height), abs=0.02)
        assert float(fitted.centre[2] + fitted.size[2] / 2) == pytest.approx(0.75, abs=0.02)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-9.0, 9.0])
def test_a_few_strays_far_outside_are_not_believed(axis, side):
    strays = torch.zeros(10, 3, dtype=torch.float64)
    strays[:, axis] = side
    scan = torch.cat((surface(200, seed=1), strays))
    fitted = fit_to_scans(surface(), [scan], mirror=True)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.03, rtol=0)


def test_of_four_scans_one_alone_is_not_believed():
    good, bad = surface(200, seed=1), surface(200, seed=1) * 1.08
    alone = fit_to_scans(surface(), [bad, *[good] * 3], mirror=True)
    torch.testing.assert_close(alone.size, SIZE, atol=0.03, rtol=0)
    two = fit_to_scans(surface(), [bad, bad, *[good] * 2], mirror=True)
    torch.testing.assert_close(two.size, SIZE * 1.08, atol=0.03, rtol=0)


@pytest.mark.parametrize("degrees", [-3.0, -1.0, 0.0, 2.0])
def test_a_canonical_frame_that_leans_is_made_level(degrees):
    leaning, middle = about_y(degrees), torch.tensor((5.0, 0.0, 2.0), dtype=torch.float64)
    fitted = fit_to_scans(surface() @ leaning.mT + middle, [], mirror=True)
    torch.testing.assert_close(fitted.rotation, leaning, atol=1e-6, rtol=0)
    torch.testing.assert_close(fitted.centre, middle, atol=0.02, rtol=0)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.03, rtol=0)


@pytest.mark.parametrize("degrees", [-40.0, 23.0])
def test_a_canonical_frame_of_depth_views_may_have_any_pitch(degrees):
    """As that of the shipped chairs, whose boxes were half as long again and stood askew."""
    tipped, middle = about_y(degrees), torch.tensor((0.5, 0.0, 0.2), dtype=torch.float64)
    fitted = fit_to_scans(surface() @ tipped.mT + middle, [], mirror=True, body=False)
    torch.testing.assert_close(fitted.rotation, tipped, atol=1e-6, rtol=0)
    torch.testing.assert_close(fitted.centre, middle, atol=0.02, rtol=0)
    torch.testing.assert_close(fitted.size, SIZE, atol=0.03, rtol=0)


def test_a_large_turn_that_gains_little_is_not_taken():
    """A ball's side view is as large however it is turned."""
    ball = torch.nn.functional.normalize(surface(size=torch.ones(3)), dim=-1)
    fitted = fit_to_scans(ball, [], mirror=True, body=False)
    assert abs(math.degrees(math.asin(float(fitted.rotation[0, 2])))) <= 4.0


def test_a_fin_does_not_tip_the_box_of_an_aeroplane():
    """The least rectangle around its side view lies along the slope from nose to fin."""
    rng = torch.Generator().manual_seed(0)
    hull = (torch.rand(3000, 3, generator=rng, dtype=torch.float64) - 0.5) * 2
    hull = torch.nn.functional.normalize(hull, dim=-1) * torch.tensor((5.0, 0.6, 0.6))
    fin = torch.rand(600, 3, generator=rng, dtype=torch.float64)
    fin = torch.stack((fin[:, 0] - 5, 0.1 * (fin[:, 1] - 0.5), 0.5 + 1.5 * fin[:, 2]), dim=1)
    shape = torch.cat((hull, fin))
    shape = torch.cat((shape, shape * torch.tensor((1.0, -1.0, 1.0))))
    fitted = fit_to_scans(shape, [], mirror=True, body=False)
    torch.testing.assert_close(fitted.rotation, torch.eye(3, dtype=torch.float64))
    assert float(fitted.size[2]) > 2.4


def test_carried_to_the_sensor_with_the_pose():
    turn = rotation_from_quaternion(torch.tensor((0.8, 0.1, -0.2, 0.5), dtype=torch.float64))
    pose = SE3(turn, torch.tensor((9.0, -3.0, 1.0), dtype=torch.float64))
    scan = pose.apply(surface(300, seed=2)).float().numpy()
    network = replace(settings().network, mirror=True)
    symmetric = replace(settings(), network=network)
    box = box_seen(surface().float(), pose, scan, symmetric)
    assert box.centre == pytest.approx(pose.translation.tolist(), abs=0.02)
    assert box.size == pytest.approx(SIZE.tolist(), abs=0.02)
    quaternion = torch.tensor(box.quaternion_wxyz, dtype=torch.float64)
    torch.testing.assert_close(rotation_from_quaternion(quaternion), turn, atol=1e-5, rtol=0)
    assert carried(fit_to_scans(surface(), [], mirror=True), pose).size == pytest.approx(
        SIZE.tolist(), abs=0.02
    )


@pytest.mark.parametrize("size", [100, 640, 2048])
@pytest.mark.parametrize("count", [1, 3])
def test_the_nth_largest_is_that_of_a_sort(size, count):
    """Equal values count as often as they are there."""
    rows = torch.randint(0, 40, (5, size), generator=torch.Generator().manual_seed(size)).float()
    assert torch.equal(_nth_largest(rows, count), rows.sort(descending=True).values[:, count - 1])


def test_the_document_names_the_numbers_of_a_box():
    page = (Path(__file__).parents[2] / "docs/boxes.md").read_text("utf-8")
    made = page.partition("## How a box is made")[2].partition("## Formats")[0]
    said = re.findall(r"(\d+(?:\.\d+)?) (?:degrees|%|to|m)(?!\w)", made)
    rule = BoxConfig()
    shares = (rule.shape_share, rule.hidden_share, rule.reach, rule.seen_share, rule.ground_share)
    ours = {rule.level_deg, rule.tipped_deg, rule.near_m, rule.unknown_m}
    ours |= {round(100 * share, 3) for share in (rule.tipped_gain, *shares)}
    assert set(map(float, said)) == ours
