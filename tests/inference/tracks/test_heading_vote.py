# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What each voice in the vote on a heading is worth."""

import itertools
import math

import pytest
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.inference.config import HeadingVoteConfig
from wildshape.inference.tracks.heading_vote import (
    continuous_signs,
    followed_signs,
    half_turn,
    likeness_of_next,
    nearness_of_next,
    slow,
    voted_signs,
)


def test_scans_follow_each_other_if_three_quarters_of_the_neighbours_turn_little():
    for fast, follows in ((1, True), (3, False)):
        steps = torch.tensor([40.0] * fast + [5.0] * (8 - fast), dtype=torch.float64)
        yaw = torch.cat((torch.zeros(1).double(), steps.cumsum(0)))
        assert slow(rotation_z(torch.deg2rad(yaw))) is follows


def test_a_scan_that_is_not_sure_at_all_counts_a_little_and_the_shape_twice():
    """A shape that speaks against its heading outweighs it from there on."""
    config = HeadingVoteConfig()
    least = config.own_m * config.unsure / config.shape_votes
    for share, sign in ((0.9, 1.0), (1.1, -1.0)):
        gain = torch.tensor((0.05, -share * least, 0.05))
        assert voted_signs(gain, torch.zeros(2), torch.zeros(3)).tolist() == [1.0, sign, 1.0]


@pytest.mark.parametrize("odd", [0, 1, 2])
def test_where_scans_do_not_follow_each_other_the_next_ones_are_heard_too(odd):
    """The shape speaks a little against one scan; it is turned, unless the others look its way."""
    gain = torch.full((3,), 1.0)
    gain[odd] = -0.1
    turned = [-1.0 if i == odd else 1.0 for i in range(3)]
    for alike, signs in ((1.0, [1.0] * 3), (0.0, turned), (-1.0, turned)):
        links = torch.tensor([alike if odd in (i, i + 1) else 1.0 for i in range(2)])
        assert voted_signs(gain, links, torch.zeros(3)).tolist() == signs


def test_of_a_scan_turned_about_the_middle_the_next_says_the_opposite():
    """Wherever the middle lies in the object's frame."""
    middle = 2.5
    x = torch.linspace(8.0, -8.0, 7, dtype=torch.float64)
    sensors = torch.stack((x, torch.full_like(x, 4.0), torch.full_like(x, 1.5)), 1)
    links = nearness_of_next(sensors, middle)
    sensors[3] = half_turn(middle).apply(sensors[3:4])[0]
    opposed = nearness_of_next(sensors, middle)
    torch.testing.assert_close(opposed[2:4], -links[2:4])
    torch.testing.assert_close(opposed[[0, 1, 4, 5]], links[[0, 1, 4, 5]])


def test_views_of_opposite_sides_lie_on_each_other_s_reflection():
    """Of an object that rises to one end, seen from its left and then from its right."""
    x = torch.linspace(-2.0, 2.0, 60)
    left = torch.stack((x, torch.full_like(x, 0.9), 0.4 * x), 1)
    views = torch.stack((left, left * torch.tensor((1.0, -1.0, 1.0))))
    far = HeadingVoteConfig().far_m
    worse = float((0.8 * x.abs() * math.cos(math.atan(0.4))).clamp(max=far).mean())
    found = likeness_of_next(views, 0.0, mirror=True)
    assert 0.8 * 2 * worse < float(found) < 2 * far
    assert abs(float(likeness_of_next(views, 0.0, mirror=False))) < 1e-3


def test_a_sensor_that_turns_a_corner_turns_no_scan_that_is_sure_of_itself():
    """Between two scans by more than a right angle: the half turn would be the smaller step."""
    yaw = torch.deg2rad(torch.tensor([19.0] * 3 + [-74.0] * 5, dtype=torch.float64))
    sure = torch.full((8,), 0.98, dtype=torch.float64)
    assert followed_signs(rotation_z(yaw), sure).tolist() == [1.0] * 8


def test_neighbours_turn_scans_around_however_sure_these_are():
    """Eight of 128 that follow each other: by an eigenvector a scan weighs the more, the more there
    are."""
    yaw = torch.deg2rad(2.0 * torch.arange(128, dtype=torch.float64))
    back = torch.zeros(128, dtype=torch.bool)
    back[60:68] = True
    rotation = rotation_z(torch.where(back, yaw + torch.pi, yaw))
    sure = torch.ones(128, dtype=torch.float64)
    assert torch.equal(followed_signs(rotation, sure) < 0, back)


def test_most_scans_stay_where_none_says_anything_of_itself():
    links, nothing = torch.tensor([1.0, -1.0, 1.0, 1.0]).double(), torch.zeros(5).double()
    assert voted_signs(nothing, links, nothing, leaps=True).tolist() == [-1.0] * 2 + [1.0] * 3


def test_the_signs_have_the_most_votes():
    """Of all there are, for poses that turn at random and speak for or against themselves."""
    generator = torch.Generator().manual_seed(0)
    reach = HeadingVoteConfig().neighbours
    for count in (1, 2, 5, 9):
        rotation = rotation_z(6.28 * torch.rand(count, generator=generator, dtype=torch.float64))
        own = torch.rand(count, generator=generator, dtype=torch.float64) - 0.3
        alike = ((rotation[:, None] * rotation).sum((-2, -1)) - 1) / 2
        near = alike.triu(1) - alike.triu(reach + 1)

        def votes(signs):
            return float(signs @ own + signs @ near @ signs)  # noqa: B023

        every = itertools.product((1.0, -1.0), repeat=count)
        most = max(votes(torch.tensor(signs, dtype=torch.float64)) for signs in every)
        assert votes(continuous_signs(rotation, own)) == pytest.approx(most)
