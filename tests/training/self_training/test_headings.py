# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks turned at random agree on a heading: within a track, across tracks, and as a whole."""

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.training.self_training.taught import sampler_of

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.inference.tracks.heading_vote import continuous_signs, turned_where
from wildshape.method.multiview import LossConfig
from wildshape.training.batches.views import ViewConfig, ViewSampler
from wildshape.training.self_training.heading_profiles import (
    ProfileConfig,
    agreed_signs,
    profile,
    together,
)
from wildshape.training.self_training.headings import (
    PosedTrack,
    agreed_rotations,
    by_scan,
    pose_track,
    settled_signs,
    signs_across,
    signs_within,
    turned_as_wholes,
)


def _wedge(generator: torch.Generator, length: float) -> torch.Tensor:
    """Points of an object whose height rises from one end to the other."""
    points = torch.rand(4000, 3, generator=generator)
    points[:, 2] *= 0.3 + points[:, 0]
    return (points - 0.5) * torch.tensor((length, 1.8, 1.5))


def test_tracks_turned_at_random_agree_on_a_heading():
    generator = torch.Generator().manual_seed(1)
    turned = torch.rand(40, generator=generator) < 0.5
    half_turn = torch.diag(torch.tensor((-1.0, -1.0, 1.0)))
    clouds = [_wedge(generator, 4 + i % 5) for i in range(40)]
    profiles = [profile(c @ half_turn if t else c) for c, t in zip(clouds, turned)]
    signs = agreed_signs(together(profiles))
    agreement = (signs > 0) == turned
    assert bool(agreement.all()) or not bool(agreement.any())


def test_a_profile_rises_where_the_object_does():
    found = profile(_wedge(torch.Generator().manual_seed(2), 5.0))
    assert bool((found.tops.diff() > 0).all())
    assert torch.allclose(found.length, torch.tensor(5.0), atol=0.2)
    sides = found.sides[0][torch.isfinite(found.sides[0])]
    assert 0.75 < float(sides.median()) < 0.85  # nine tenths of 0.9


def test_unseen_slices_do_not_count():
    generator = torch.Generator().manual_seed(3)
    profiles = together([profile(_wedge(generator, 4.0)) for _ in range(6)])
    profiles.tops[0, :6] = float("nan")
    assert len(set(agreed_signs(profiles).tolist())) == 1


def test_each_kind_agrees_even_if_another_kind_rises_the_other_way():
    """Trucks, high in front, agree among each other beside many cars that rise to the back."""
    generator = torch.Generator().manual_seed(4)
    half_turn = torch.diag(torch.tensor((-1.0, -1.0, 1.0)))
    cars = [_wedge(generator, 4 + i % 5 / 4) for i in range(40)]
    trucks = [_wedge(generator, 9 + i % 3) @ half_turn for i in range(15)]
    turned = torch.rand(55, generator=generator) < 0.5
    clouds = [c @ half_turn if t else c for c, t in zip(cars + trucks, turned)]
    signs = agreed_signs(together([profile(c) for c in clouds]))
    agreement = (signs > 0) == turned
    for kind in (agreement[:40], agreement[40:]):
        assert bool(kind.all()) or not bool(kind.any())


def test_half_turns_within_a_track_are_found():
    yaw = torch.linspace(0.0, 1.2, 20)
    flipped = torch.zeros(20, dtype=torch.bool)
    flipped[[3, 4, 11, 19]] = True
    rotation = rotation_z(torch.where(flipped, yaw + torch.pi, yaw))
    signs = continuous_signs(rotation)
    assert bool(((signs < 0) == flipped).all()) or bool(((signs > 0) == flipped).all())


def test_a_turned_pose_leaves_the_object_s_middle_where_it_was():
    """The far end takes the near one's place: nothing moves in the sensor's frame but the ends."""
    yaw = torch.tensor((0.3, 2.0))
    posed = SE3(rotation_z(yaw), torch.tensor(((9.0, 1.0, 0.0), (5.0, -4.0, 0.2))))
    turned = turned_where(posed, torch.tensor((1.0, -1.0)), 0.7)
    ends = torch.tensor(((2.7, 0.0, 0.0), (-1.3, 0.0, 0.0)))
    torch.testing.assert_close(turned[0].apply(ends), posed[0].apply(ends))
    torch.testing.assert_close(turned[1].apply(ends), posed[1].apply(ends).flip(0))


def _wedges(count, turned):
    """Profiles of wedges, some of them turned."""
    generator = torch.Generator().manual_seed(5)
    half_turn = torch.diag(torch.tensor((-1.0, -1.0, 1.0)))
    clouds = [_wedge(generator, 4 + i % 5) for i in range(count)]
    return together([profile(c @ half_turn if t else c) for c, t in zip(clouds, turned)])


@pytest.mark.parametrize("looks", [1.0, -1.0])
def test_of_two_ways_all_look_the_one_that_most_scans_look_already(looks):
    """Tracks 0 to 3 are turned; they have few scans, and then many."""
    turned = torch.arange(12) < 4
    scans = [30 if t == (looks < 0) else 2 for t in turned.tolist()]
    votes = [torch.ones(count) for count in scans]
    signs = signs_across(_wedges(12, turned), votes, ProfileConfig())
    assert torch.equal(signs, looks * torch.where(turned, -1.0, 1.0))


def _standing(count, place=(0.0, 8.0, 0.0)):
    """Scans that all see their object from one place of its own frame."""
    rotation = torch.eye(3).expand(count, 3, 3)
    return PosedTrack(np.arange(count), SE3(rotation, -torch.tensor(place).expand(count, 3)), 0.0)


def test_a_clear_network_s_own_word_counts_against_the_profiles():
    """All say that track 0 looks as posed, whatever its profile: settled, it is left so."""
    profiles, tracks = _wedges(12, torch.arange(12) < 1), [_standing(10)] * 12
    votes = [torch.ones(10)] * 12
    signs = signs_across(profiles, votes, ProfileConfig())
    assert signs.tolist() == [-1.0] + [1.0] * 11
    assert settled_signs(tracks, votes, profiles, signs).tolist() == [1.0] * 12


def test_a_whole_track_turns_about_the_middle_of_its_object():
    tracks = turned_as_wholes([_standing(2), _standing(2)], torch.tensor((1.0, -1.0)))
    left = tracks[0].T_sensor_can.inverse().translation
    torch.testing.assert_close(left, torch.tensor((0.0, 8.0, 0.0)).expand(2, 3))
    torch.testing.assert_close(tracks[1].T_sensor_can.inverse().translation, -left)


def test_poses_lie_at_the_rows_of_their_scans_and_others_are_zero():
    T_sensor_can = SE3(torch.eye(3).expand(2, 3, 3), torch.arange(6.0).view(2, 3))
    found = by_scan([PosedTrack(np.array((3, 1)), T_sensor_can, 0.0)], 5)
    assert found.translation.tolist() == [[0] * 3, [3, 4, 5], [0] * 3, [0, 1, 2], [0] * 3]
    assert not bool(found.rotation[::2].any())


def _posed(cars, index, flipped):
    """A car's true poses, some of them turned."""
    true = poses_of(cars[index])
    true = SE3(true.rotation.float(), true.translation.float())
    rows = np.arange(len(true)) + index * len(true)
    return PosedTrack(rows, true, 0.0).turned(torch.where(flipped, -1.0, 1.0))


@pytest.mark.parametrize("time_ordered", [True, False])
def test_the_scans_of_a_track_are_brought_to_look_one_way(cars, car_store, time_ordered):
    sampler = sampler_of(car_store)
    flipped = torch.arange(12) % 5 == 0
    signs = signs_within(sampler, _posed(cars, 2, flipped), time_ordered=time_ordered, mirror=True)
    assert bool(((signs < 0) == flipped).all()) or bool(((signs > 0) == flipped).all())


@pytest.fixture(scope="module")
def shipped(car_store):
    """The network, and the cars as it reads them."""
    predictor = load(raw=True)
    config = ViewConfig(points=predictor.settings.input_points, turn="facing")
    return predictor, ViewSampler(car_store, np.arange(len(car_store)), config)


def test_a_track_is_posed_in_its_sensors_frames_and_its_middle_is_that_of_its_shapes(
    cars, shipped, monkeypatch
):
    """Also of a network whose shapes lie beside their origin."""
    predictor, sampler = shipped
    track = pose_track(predictor.network, sampler, predictor.settings, sampler.scans_of[2])
    assert abs(track.middle_x) < 0.3
    off = track.T_sensor_can.translation - poses_of(cars[2]).translation
    assert float(off.norm(dim=-1).median()) < 0.4
    beside, forward = torch.tensor((1.5, 0.0, 0.0)), predictor.network.forward

    def shifted(*args):
        shapes, rotation, translation, belief = forward(*args)
        return shapes + beside, rotation, translation - rotation @ beside, belief

    monkeypatch.setattr(predictor.network, "forward", shifted)
    again = pose_track(predictor.network, sampler, predictor.settings, sampler.scans_of[2])
    assert again.middle_x == pytest.approx(track.middle_x + 1.5, abs=1e-3)


def test_all_tracks_of_a_network_look_one_way(cars, shipped):
    """The shipped network's headings, against the truth: right for all, or turned for all."""
    predictor, sampler = shipped
    loss = LossConfig(beta=0.25, projection=predictor.settings.projection, time_ordered=True)
    rotation = agreed_rotations(predictor.network, sampler, loss)
    true = torch.cat([poses_of(car).rotation for car in cars]).float()
    ahead = (rotation * true)[:, :, 0].sum(-1)
    assert bool((ahead > 0.9).all()) or bool((ahead < -0.9).all())
