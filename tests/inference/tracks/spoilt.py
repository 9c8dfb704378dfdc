# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses of a track spoilt a little, and compared."""

import math

import torch
from tests.strategies import rotation_about

from wildshape.geometry.transforms.se3 import SE3, stack


def spoilt(T_sensor_object, seed, degrees=4.0, metres=0.15):
    """Each pose turned and moved a little, about the object's own centre."""
    generator = torch.Generator().manual_seed(seed)
    made = []
    for i in range(len(T_sensor_object)):
        axis = torch.randn(3, generator=generator).double()
        angle = math.radians(degrees) * float(torch.rand(1, generator=generator))
        shift = metres * (2 * torch.rand(3, generator=generator).double() - 1)
        made.append(T_sensor_object[i] @ SE3(rotation_about(axis.tolist(), angle), shift))
    return stack(made)


def relative(poses):
    """Every scan to the first one's frame: what the frame of the object has no part in."""
    return poses[0] @ poses.inverse()
