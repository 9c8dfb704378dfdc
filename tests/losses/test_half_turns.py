# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A shape turned by half about its own axes: the rotation, the axes, and what is drawn."""

import torch

from wildshape.geometry.rotation import random_rotation, rotation_from_quaternion
from wildshape.losses.half_turns import half_turned, principal_axes, some_half_turn


def poses(count):
    draws = torch.randn(count, 4, generator=torch.Generator().manual_seed(0))
    return torch.nn.functional.normalize(draws, dim=1)


def stretched():
    """Points spread 1 : 2 : 4 along axes turned at random, and these axes as rows."""
    generator = torch.Generator().manual_seed(1)
    axes = random_rotation(1, generator)[0].mT
    along = torch.randn(4000, 3, generator=generator) * torch.tensor([0.05, 0.1, 0.2])
    return along @ axes + 0.3, axes


def test_the_shape_is_turned_before_it_is_posed():
    pose, axis = poses(5), poses(5)[:, :3]
    axis = axis / axis.norm(dim=1, keepdim=True)
    turn = 2 * axis[:, :, None] * axis[:, None] - torch.eye(3)
    found = rotation_from_quaternion(half_turned(pose, axis))
    torch.testing.assert_close(found, rotation_from_quaternion(pose) @ turn)


def test_the_axes_are_those_along_which_points_spread():
    cloud, axes = stretched()
    found = principal_axes(cloud[None])[0]
    assert ((found * axes).sum(1).abs() > 0.999).all()


def test_every_axis_is_tried_and_the_pose_itself_is_not_taught():
    cloud, axes = stretched()
    pose = poses(1).repeat(30, 1).requires_grad_()
    clouds = cloud.expand(30, -1, -1)
    found = some_half_turn(pose, clouds, torch.Generator().manual_seed(0))
    expected = torch.cat([half_turned(pose[:1], axis[None]) for axis in axes])
    likeness = (found @ expected.mT).abs()
    assert not found.requires_grad
    assert (likeness.amax(1) > 0.999).all()
    assert likeness.argmax(1).unique().tolist() == [0, 1, 2]
