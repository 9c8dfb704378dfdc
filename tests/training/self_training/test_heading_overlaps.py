# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Unordered views of one object agree on its heading, whichever side each of them sees."""

import pytest
import torch

from wildshape.training.self_training.heading_overlaps import _contradiction, agreeing_signs

HALF_TURN = torch.tensor((-1.0, -1.0, 1.0))


def views_of_a_wedge(size):
    """Six views, from all around, of the side that each sees of a convex wedge, high at one end."""
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(20_000, 3, generator=generator) * 2 - 1
    face = torch.arange(len(points)) % 3
    points[torch.arange(len(points)), face] = points[torch.arange(len(points)), face].sign()
    normals = torch.zeros_like(points)
    normals[torch.arange(len(points)), face] = points.gather(1, face[:, None])[:, 0]
    points = points * torch.tensor((0.5, 0.2, 0.15))
    points[:, 2] *= 1 + 1.2 * points[:, 0]
    clouds, sensors = [], []
    for angle in 0.3 + torch.arange(6) * 1.1:
        at = 2 * torch.stack((torch.cos(angle), torch.sin(angle), torch.tensor(0.3)))
        seen = ((at - points) * normals).sum(1) > 0
        clouds.append(points[seen][:300])
        sensors.append(at)
    return size * torch.stack(clouds), size * torch.stack(sensors)


def some_turned(part, flipped):
    return torch.where(flipped.view(-1, *(1,) * (part.ndim - 1)), part * HALF_TURN, part)


@pytest.mark.parametrize("size", [1.0, 0.05])
@pytest.mark.parametrize("mirror", [False, True])
def test_views_turned_at_random_are_found(size, mirror):
    flipped = torch.tensor([False, True, True, False, False, True])
    clouds, sensors = (some_turned(part, flipped) for part in views_of_a_wedge(size))
    signs = agreeing_signs(clouds, sensors, mirror=mirror)
    assert bool(((signs < 0) == flipped).all()) or bool(((signs > 0) == flipped).all())


def test_objects_are_turned_about_their_middle_wherever_the_origin_lies():
    """A network's canonical shape may lie beside its origin; turned about that, all would miss."""
    shift = torch.tensor((0.4, 0.0, 0.0))
    flipped = torch.tensor([True, False, True, False, True, False])
    clouds, sensors = (some_turned(part, flipped) + shift for part in views_of_a_wedge(1.0))
    signs = agreeing_signs(clouds, sensors, 0.4, mirror=True)
    assert bool(((signs < 0) == flipped).all()) or bool(((signs > 0) == flipped).all())


def test_views_that_agree_are_left_alone():
    assert len(set(agreeing_signs(*views_of_a_wedge(1.0), mirror=True).tolist())) == 1


def test_what_stands_before_or_beside_a_view_contradicts_it_and_what_it_hides_does_not():
    """A wall of 2 m before a sensor at the origin, 5 m away."""
    y, z = torch.meshgrid(torch.arange(-1, 1.01, 0.1), torch.arange(-1, 1.01, 0.1), indexing="ij")
    wall = torch.stack((torch.full_like(y, 5.0), y, z), -1).view(-1, 3)
    behind, before = wall * 1.3, wall * 0.99
    beside = torch.tensor((5.0, 1.2, 0.0)).expand(9, 3)
    far = torch.tensor((5.0, 4.0, 0.0)).expand(9, 3)
    found = [
        float(_contradiction(points[None], wall, torch.zeros(3), 0.5))
        for points in (wall, behind, before, beside, far, wall * 0.5)
    ]
    ahead = 0.01 * float(wall.norm(dim=1).mean())
    assert found == pytest.approx([0.0, 0.0, ahead, 0.2, 0.5, 0.5], abs=0.02)
