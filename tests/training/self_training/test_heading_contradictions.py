# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A kind that its end-on views contradict is turned, and no other; a network's own word counts."""

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.training.self_training.heading_contradictions import (
    EndOn,
    end_on,
    own_signs,
    uncontradicted_signs,
)
from wildshape.training.self_training.heading_profiles import Profiles, reversed_where
from wildshape.training.self_training.headings import PosedTrack, settled_signs


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


def test_kinds_are_told_apart_as_they_look_after_all_agreed():
    """Of one size, one rises and one falls; before, each track lay as it happened to."""
    fall = torch.where(torch.arange(65) < 40, 1.0, -1.0)
    agreed = _profiles(torch.full((65,), 4.0))
    agreed = agreed._replace(tops=agreed.tops * fall[:, None])
    signs = torch.where(torch.arange(65) % 2 == 0, 1.0, -1.0)
    opposed = torch.zeros(65, 2)
    opposed[40:, 0] = 2.0
    found = EndOn(opposed, torch.full((65, 2), 4.0))
    before = reversed_where(agreed, signs < 0)
    assert torch.equal(uncontradicted_signs(before, signs, found), signs * fall)


def test_a_kind_hardly_seen_end_on_is_left_as_it_is():
    profiles, found = _two_kinds(0.5)
    few = EndOn(*(part / 16 for part in found))  # of 20 most alike, 5 scans
    assert torch.equal(uncontradicted_signs(profiles, torch.ones(85), few), torch.ones(85))


def test_tracks_of_a_kind_that_their_own_end_on_scans_contradict_are_turned():
    """Seen by sensors straight ahead of the object, whichever way they look themselves."""
    profiles, _ = _two_kinds(0.0)
    turn, place = rotation_z(torch.full((4,), 1.5)), torch.tensor((10.0, 0.0, 1.0))
    T_sensor_can = SE3(turn, -(turn @ place))
    tracks = [PosedTrack(np.arange(4), T_sensor_can, 0.0)] * 85
    torn, clear = torch.tensor((1.0, -1.0, 1.0, -1.0)), torch.ones(4)
    votes = [clear] * 60 + [torn] * 25
    signs = settled_signs(tracks, votes, profiles, torch.ones(85))
    assert signs.tolist() == [1.0] * 60 + [-1.0] * 25


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


def test_how_clear_a_network_is_is_counted_in_scans():
    """It is about ten short tracks, not about a long one: of most scans it is not."""
    said = [torch.ones(2)] * 10 + [torch.tensor((1.0, -1.0)).repeat(100)]
    signs = torch.tensor([-1.0] * 11)
    assert torch.equal(own_signs(signs, said), signs)


def test_a_network_that_is_not_clear_in_general_is_not_asked():
    signs = torch.ones(20)
    assert torch.equal(own_signs(signs, votes(*[8, 2] * 9, 10, 0)), signs)
