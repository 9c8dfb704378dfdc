# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch

from wildshape.geometry.rotation import rotation_z
from wildshape.training.headings import agreed_signs, outline, steady_signs


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
    outlines = [outline(c @ half_turn if t else c) for c, t in zip(clouds, turned)]
    signs = agreed_signs(torch.stack(outlines))
    agreement = (signs > 0) == turned
    assert bool(agreement.all()) or not bool(agreement.any())


def test_an_outline_rises_where_the_object_does():
    heights = outline(_wedge(torch.Generator().manual_seed(2), 5.0))
    assert bool((heights.diff() > 0).all())


def test_unseen_slices_do_not_count():
    generator = torch.Generator().manual_seed(3)
    outlines = torch.stack([outline(_wedge(generator, 4.0)) for _ in range(6)])
    outlines[0, :6] = float("nan")
    assert len(set(agreed_signs(outlines).tolist())) == 1


def test_half_turns_within_a_track_are_found():
    yaw = torch.linspace(0.0, 1.2, 20)
    flipped = torch.zeros(20, dtype=torch.bool)
    flipped[[3, 4, 11, 19]] = True
    rotation = rotation_z(torch.where(flipped, yaw + torch.pi, yaw))
    signs = steady_signs(rotation)
    assert bool(((signs < 0) == flipped).all()) or bool(((signs > 0) == flipped).all())
