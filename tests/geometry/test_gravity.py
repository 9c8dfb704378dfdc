# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What sensors that are held level have in common, and frames that do not pitch against them."""

import math

import pytest
import torch

from wildshape.geometry.gravity import level_turn, mean_up
from wildshape.geometry.transforms.rotation import random_rotation


def about_y(angle):
    c, s = math.cos(angle), math.sin(angle)
    return torch.tensor(((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)))


def level_sensors(count=20):
    """`R_sensor_object` for any heading."""
    angle = torch.linspace(0.0, 6.0, count)
    c, s, zero, one = angle.cos(), angle.sin(), torch.zeros(count), torch.ones(count)
    return torch.stack((c, -s, zero, s, c, zero, zero, zero, one), -1).view(count, 3, 3)


def test_what_level_sensors_call_up():
    leaning = level_sensors() @ about_y(0.02)
    expected = torch.tensor((-math.sin(0.02), 0.0, math.cos(0.02)))
    torch.testing.assert_close(mean_up(leaning), expected, atol=1e-6, rtol=0)


def test_sensors_of_any_orientation_have_no_up():
    assert mean_up(random_rotation(200, torch.Generator().manual_seed(0))) is None


@pytest.mark.parametrize("pitch", [-0.2, 0.0, 0.02])
def test_a_frame_pitches_no_more(pitch):
    """Of the pitch nothing is left, and roll, of which the mirror plane knows more, stays."""
    roll = torch.tensor(((1.0, 0.0, 0.0), (0.0, 0.9998, -0.02), (0.0, 0.02, 0.9998)))
    leaning = level_sensors() @ roll @ about_y(pitch)
    levelled = leaning @ level_turn(leaning)
    up = mean_up(levelled)
    assert up is not None
    assert abs(float(up[0])) < 1e-6
    assert abs(float(up[1]) - float((level_sensors() @ roll)[0, 2, 1])) < 1e-3


@pytest.mark.parametrize(
    "rotation",
    [random_rotation(50, torch.Generator().manual_seed(1)), level_sensors() @ about_y(1)],
)
def test_what_is_not_nearly_level_is_left(rotation):
    torch.testing.assert_close(level_turn(rotation), torch.eye(3))
