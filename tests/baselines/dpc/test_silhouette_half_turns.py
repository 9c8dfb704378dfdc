# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A shape turned by half: which rotation that is, and about what."""

import torch

from wildshape.baselines.dpc.silhouette import common_up, half_turned
from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    random_rotation,
    rotation_from_quaternion,
    rotation_z,
)


def generator():
    return torch.Generator().manual_seed(0)


def test_the_shape_is_turned_before_it_is_posed():
    poses = random_rotation(5, generator())
    axis = random_rotation(1, generator())[0, 0]
    turn = 2 * torch.outer(axis, axis) - torch.eye(3)
    found = half_turned(quaternion_from_rotation(poses), axis)
    torch.testing.assert_close(found.norm(dim=1), torch.ones(5))
    torch.testing.assert_close(rotation_from_quaternion(found), poses @ turn)


def test_up_is_found_from_sensors_held_upright_around_the_object():
    canonical = random_rotation(1, generator())[0]  # R_object_canonical
    headings = rotation_z(torch.arange(8) * torch.pi / 4)
    nods = torch.tensor([0.2, -0.2]).repeat(4)
    zero, one = torch.zeros(8), torch.ones(8)
    rows = (one, zero, zero, zero, nods.cos(), -nods.sin(), zero, nods.sin(), nods.cos())
    poses = torch.stack(rows, dim=1).view(8, 3, 3) @ headings @ canonical
    found = common_up(quaternion_from_rotation(poses), torch.tensor([0.0, 0.0, 1.0]))
    torch.testing.assert_close(found, canonical.T[:, 2], atol=1e-4, rtol=0)
