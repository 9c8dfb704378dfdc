# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A steady motion: from two poses, and points carried along it."""

import numpy as np
import pytest
import torch
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import STANDING, Twist


def matrix_of(twist, seconds):
    """By the series: the exponential of the 4x4 matrix of the motion."""
    (x, y, z), v = twist.angular, twist.linear
    generator = np.zeros((4, 4))
    generator[:3, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    generator[:3, 3] = v
    return expm(generator * seconds)


TWISTS = [
    Twist((0.1, -0.3, 0.8), (12.0, 0.4, -0.2)),
    Twist((0.0, 0.0, 0.0), (3.0, 1.0, 0.0)),
    Twist((0.0, 1e-12, 0.0), (3.0, 1.0, 0.0)),
    Twist((0.0, 0.0, 20.0), (0.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("twist", TWISTS)
def test_each_point_is_carried_by_its_own_time(twist):
    rng = np.random.default_rng(0)
    points, seconds = rng.normal(0, 20, (50, 3)), rng.uniform(-0.1, 0.1, 50)
    carried = twist.carry(points, seconds)
    for point, time, found in zip(points, seconds, carried):
        T = matrix_of(twist, time)
        assert found == pytest.approx(T[:3, :3] @ point + T[:3, 3], abs=1e-9)
    assert twist.after(0.1).matrix.numpy() == pytest.approx(matrix_of(twist, 0.1), abs=1e-12)
    assert twist.carry(points.astype(np.float32), seconds).dtype == np.float32


@pytest.mark.parametrize("twist", TWISTS)
def test_the_motion_between_two_poses_is_found_again(twist):
    turn = Rotation.from_euler("xyz", (0.3, -1.0, 2.0)).as_matrix()
    start = SE3(torch.from_numpy(turn), torch.tensor((400.0, -3.0, 2.0)).double())
    found = Twist.between(start, start @ twist.after(0.1), 0.1)
    assert found.angular == pytest.approx(twist.angular, abs=1e-9)
    assert found.linear == pytest.approx(twist.linear, abs=1e-9)
    assert Twist.between(start, start, 0.1).linear == pytest.approx((0, 0, 0), abs=1e-9)


def test_standing_changes_nothing():
    points = np.random.default_rng(0).normal(0, 20, (50, 3)).astype(np.float32)
    assert np.array_equal(STANDING.carry(points, np.full(50, 0.1)), points)
    assert np.array_equal(STANDING.after(0.1).matrix.numpy(), np.eye(4))
