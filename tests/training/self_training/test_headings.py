# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks.heading_vote import continuous_signs, turned_where
from wildshape.training.self_training.heading_profiles import agreed_signs, profile, together


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
    """Lorries, high in front, agree among each other beside many cars that rise to the back."""
    generator = torch.Generator().manual_seed(4)
    half_turn = torch.diag(torch.tensor((-1.0, -1.0, 1.0)))
    cars = [_wedge(generator, 4 + i % 5 / 4) for i in range(40)]
    lorries = [_wedge(generator, 9 + i % 3) @ half_turn for i in range(15)]
    turned = torch.rand(55, generator=generator) < 0.5
    clouds = [c @ half_turn if t else c for c, t in zip(cars + lorries, turned)]
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
    given = SE3(rotation_z(yaw), torch.tensor(((9.0, 1.0, 0.0), (5.0, -4.0, 0.2))))
    turned = turned_where(given, torch.tensor((1.0, -1.0)), 0.7)
    ends = torch.tensor(((2.7, 0.0, 0.0), (-1.3, 0.0, 0.0)))
    torch.testing.assert_close(turned[0].apply(ends), given[0].apply(ends))
    torch.testing.assert_close(turned[1].apply(ends), given[1].apply(ends).flip(0))
