# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is up, for sensors that are held level (beyond the paper).

A LiDAR on a vehicle stands on the road that its objects stand on: its z axis and theirs differ by a
degree or less, where a single scan tells an object's pitch and roll to a degree or two.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

_TOGETHER = 0.9  # length of the mean of axes from which on they have a direction in common
_MOST_DEG = 30.0  # a pitch over this is no tilt of the frame but a wrong pose


def mean_up(R_sensor_object: Float[Tensor, "V 3 3"]) -> Float[Tensor, "3"] | None:
    """The direction, object frame, that the sensors' z axes have in common; None if they do not.

    Args:
        R_sensor_object: of scans of one object, or of many in one canonical frame.
    """
    mean = R_sensor_object[:, 2].mean(0)
    length = float(mean.norm())
    return mean / length if length > _TOGETHER else None


def level_turn(R_sensor_object: Float[Tensor, "V 3 3"]) -> Float[Tensor, "3 3"]:
    """`R_object_levelled`: a turn about the object's y axis after which its z axis points up.

    Scans of a track say nothing of the pitch of the frame that they are posed in: it is chosen. Of
    roll the mirror plane y = 0 says more. The identity where the sensors are not level.
    """
    up = mean_up(R_sensor_object)
    pitch = 0.0 if up is None else math.atan2(float(up[0]), float(up[2]))
    if abs(pitch) > math.radians(_MOST_DEG):
        pitch = 0.0
    c, s = math.cos(pitch), math.sin(pitch)
    return torch.tensor(((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))).to(R_sensor_object)
