# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses between two poses, against the rotation vector of the way between them."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from wildshape.geometry.transforms.se3 import SE3, between


def pose(rotation, translation):
    return SE3(
        torch.as_tensor(rotation.as_matrix()), torch.tensor(translation, dtype=torch.float64)
    )


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.3, 3.1])
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
# From the last one on, the turn from the identity goes over a half.
@pytest.mark.parametrize("start", [(0.4, 2.0, -1.7), (1.86, -1.488, 1.984)])
def test_a_share_of_the_way_is_that_share_of_the_turn(angle, share, start):
    way = np.array((0.6, -0.48, 0.64)) * angle
    first = Rotation.from_rotvec(start)
    middle = between(
        pose(first, (1.0, 2.0, 3.0)),
        pose(Rotation.from_rotvec(way) * first, (3.0, 2.0, -1.0)),
        share,
    )
    expected = (Rotation.from_rotvec(share * way) * first).as_matrix()
    assert middle.rotation.numpy() == pytest.approx(expected, abs=1e-9)
    assert middle.translation.tolist() == pytest.approx([1 + 2 * share, 2.0, 3 - 4 * share])


def test_between_a_pose_and_itself_is_that_pose():
    """Also where a quaternion times itself is rounded to more than 1."""
    for vector in np.random.default_rng(0).normal(size=(50, 3)):
        same = pose(Rotation.from_rotvec(vector), (1.0, 2.0, 3.0))
        middle = between(same, same, 0.5)
        assert middle.matrix.numpy() == pytest.approx(same.matrix.numpy(), abs=1e-9)
