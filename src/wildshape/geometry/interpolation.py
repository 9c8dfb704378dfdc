# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses between two poses."""

import torch

from wildshape.geometry.rotation import quaternion_from_rotation, rotation_from_quaternion
from wildshape.geometry.se3 import SE3

_NEARLY_EQUAL = 1e-7


def between(start: SE3, end: SE3, share: float) -> SE3:
    """The pose after a share of the way, linear in place and slerp in attitude (Shoemake 1985).

    Args:
        start: `T_a_b` at share 0, one pose.
        end: `T_a_b` at share 1, one pose.
        share: 0 to 1.
    """
    p = quaternion_from_rotation(start.rotation)
    q = quaternion_from_rotation(end.rotation)
    # q and -q are the same attitude; the nearer one is the shorter way.
    cosine = (p * q).sum()
    q, cosine = (-q, -cosine) if cosine < 0 else (q, cosine)
    angle = torch.acos(cosine.clamp(max=1.0))
    if angle < _NEARLY_EQUAL:
        weights = (1.0 - share, share)
    else:
        weights = (torch.sin((1 - share) * angle), torch.sin(share * angle))
    turned = rotation_from_quaternion(weights[0] * p + weights[1] * q)
    return SE3(turned, (1 - share) * start.translation + share * end.translation)
