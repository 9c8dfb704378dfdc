# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A kind that its end-on views contradict is turned, and no other; a network's own word counts."""

import torch

from wildshape.training.self_training.heading_contradictions import (
    EndOn,
    end_on,
    own_signs,
    uncontradicted_signs,
)
from wildshape.training.self_training.heading_profiles import Profiles


def _profiles(lengths: torch.Tensor) -> Profiles:
    """Objects that rise along x; kinds are told apart by their length."""
    count = len(lengths)
    tops = torch.linspace(-0.4, 0.4, 16).expand(count, 16).clone()
    return Profiles(tops, torch.ones(count, 16, 6), lengths, torch.full((count,), 1.5))


def _two_kinds(opposed_of_the_second: float) -> tuple[Profiles, EndOn]:
    lengths = torch.cat((torch.linspace(4.0, 4.2, 60), torch.linspace(9.0, 9.2, 25)))
    opposed = torch.zeros(85, 2)
    opposed[60:, 0] = opposed_of_the_second * 4
    return _profiles(lengths), EndOn(opposed, torch.full((85, 2), 4.0))


def test_a_contradicted_kind_is_turned_and_no_other():
    profiles, found = _two_kinds(0.5)
    signs = torch.where(torch.arange(85) % 2 == 0, 1.0, -1.0)  # as the tracks happened to lie
    turned = Profiles(
        torch.where(signs[:, None] < 0, profiles.tops.flip(1), profiles.tops), *profiles[1:]
    )
    assert torch.equal(uncontradicted_signs(turned, signs, found)[:60], signs[:60])
    assert torch.equal(uncontradicted_signs(turned, signs, found)[60:], -signs[60:])


def test_a_few_contradictions_turn_nothing():
    profiles, found = _two_kinds(0.1)
    assert torch.equal(uncontradicted_signs(profiles, torch.ones(85), found), torch.ones(85))


def test_a_network_that_contradicts_itself_everywhere_turns_nothing():
    """It has learned no headings yet: its word is worth nothing."""
    profiles, found = _two_kinds(0.5)
    found = EndOn(torch.full((85, 2), 2.0), found.all)
    assert torch.equal(uncontradicted_signs(profiles, torch.ones(85), found), torch.ones(85))


def test_only_views_along_the_object_count_and_each_at_its_end():
    places = torch.tensor(((10.0, 1.0, 1.0), (10.0, -1.0, 1.0), (-9.0, 0.0, 1.0), (5.0, 9.0, 1.0)))
    votes = torch.tensor((1.0, -1.0, 1.0, -1.0))
    found = end_on(votes, places, torch.tensor(1.0))
    assert found.all.tolist() == [[2.0, 1.0]]
    assert found.opposed.tolist() == [[1.0, 0.0]]
    turned = end_on(votes, places, torch.tensor(-1.0))
    assert turned.all.tolist() == [[1.0, 2.0]]
    assert turned.opposed.tolist() == [[1.0, 1.0]]


def votes(*shares):
    """Of each track of ten scans, that many say that it looks the way it does."""
    return [torch.where(torch.arange(10) < share, 1.0, -1.0) for share in shares]


def test_a_clear_network_is_believed_where_it_is_clear():
    said = votes(*[10] * 40, 0, 6, 4)
    signs = own_signs(torch.tensor([1.0] * 40 + [1.0, -1.0, 1.0]), said)
    assert signs.tolist() == [1.0] * 40 + [-1.0, -1.0, 1.0]


def test_a_network_that_is_not_clear_in_general_is_not_asked():
    signs = torch.ones(20)
    assert torch.equal(own_signs(signs, votes(*[8, 2] * 9, 10, 0)), signs)
