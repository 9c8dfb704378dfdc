# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How unlike two objects are, and what that is worth as a vote."""

from dataclasses import replace

import pytest
import torch

from wildshape.training.self_training.heading_profiles import (
    ProfileConfig,
    Profiles,
    _evidence,
    agreed_signs,
    difference,
    nearest_profiles,
    profile,
    reversed_where,
    together,
)

CONFIG = ProfileConfig()


def rising(length=4.0, height=1.5, rise=0.4, breadth=0.8):
    """One object, higher and broader towards +x, as a profile."""
    slope = torch.linspace(-1.0, 1.0, 16)
    sides = breadth + 0.1 * slope[:, None].expand(16, 6)
    return Profiles(rise * slope[None], sides[None], torch.tensor([length]), torch.tensor([height]))


def test_an_object_turned_around_has_its_profile_reversed():
    points = torch.rand(20_000, 3, generator=torch.Generator().manual_seed(0))
    points = (points - 0.5) * torch.tensor((4.0, 1.8, 1.5))
    points[:, 1:] *= 1 + 0.15 * points[:, :1]
    turned = profile(points * torch.tensor((-1.0, -1.0, 1.0)))
    back = reversed_where(turned, torch.tensor([True]))
    stands = profile(points)
    for one, other in zip(stands[:2], back[:2]):
        assert float((one - other).abs().nanmean()) < 0.01
    for one, other in zip(stands[:2], turned[:2]):
        assert float((one - other).abs().nanmean()) > 0.1


def test_tops_sides_and_sizes_make_objects_unlike():
    one = rising()
    longer, higher = rising(length=6.0), rising(height=2.0)
    steeper, broader = rising(rise=0.8), rising(breadth=1.0)
    expected = (2 * CONFIG.length, 0.5 * CONFIG.height, 0.4 * 8 / 15, 0.2, 0.0)
    for other, apart in zip((longer, higher, steeper, broader, one), expected):
        assert float(difference(one, other)) == pytest.approx(apart, abs=1e-5)


def test_where_nothing_was_seen_of_both_they_are_as_unlike_as_is_said():
    left, right = rising(), rising()
    left.tops[0, 8:], right.tops[0, :8] = torch.nan, torch.nan
    assert float(difference(left, right)) == pytest.approx(CONFIG.unseen_m)
    right.tops[0, 7] = left.tops[0, 7] + 0.3
    assert float(difference(left, right)) == pytest.approx(0.3)


def test_a_neighbour_that_fits_as_it_stands_alone_votes_with_all_its_weight():
    """Whatever its size; those that are less alike hardly vote."""
    objects = together([rising(), rising(length=4.5), rising(length=9.0)])
    turned = reversed_where(objects, torch.tensor([False, True, False]))
    votes = _evidence(turned, turned, replace(CONFIG, neighbours=1))
    rest = CONFIG.everybody / 3
    expected = torch.tensor([[0.0, -1.0, rest], [-1.0, 0.0, -rest], [rest, -1.0, 0.0]])
    torch.testing.assert_close(votes, expected, atol=1e-5, rtol=0)


def test_more_objects_than_agree_among_each_other_follow_these():
    turned = torch.rand(30, generator=torch.Generator().manual_seed(1)) < 0.4
    objects = reversed_where(together([rising(4 + i % 7 / 2) for i in range(30)]), turned)
    signs = agreed_signs(objects, replace(CONFIG, references=8, neighbours=3))
    agreement = (signs > 0) == turned
    assert bool(agreement.all()) or not bool(agreement.any())


def test_the_nearest_are_found_some_rows_at_a_time():
    """150 objects: two whole parts and a piece of a third."""
    draw = torch.Generator().manual_seed(0)
    size = 3 + torch.rand(150, generator=draw)
    tops, sides = (torch.rand(150, *bins, generator=draw) for bins in ((16,), (16, 6)))
    many = Profiles(tops, sides, size, size / 3)
    expected = difference(many, many).topk(20, largest=False).indices
    assert torch.equal(nearest_profiles(many, 20), expected)
    assert nearest_profiles(many, 200).shape == (150, 150)
