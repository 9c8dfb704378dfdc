# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Half turns about what is up: where images of an elongated object mislead its pose.

Seen blurred, an airplane looks alike from two opposed sides. A pose network that has settled for
the wrong one does not leave it by descent; the image of the pose turned by half tells.
"""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from wildshape.geometry.rotation import rotation_from_quaternion


def half_turned(pose: Float[Tensor, "B 4"], axis: Float[Tensor, "3"]) -> Float[Tensor, "B 4"]:
    """The pose of the shape turned by 180 degrees about an axis of its own.

    Args:
        pose: unit quaternions w, x, y, z, `R_sensor_canonical`.
        axis: unit vector, canonical frame.
    """
    scalar, vector = pose[:, :1], pose[:, 1:]
    turned = scalar * axis + torch.linalg.cross(vector, axis.expand_as(vector))
    return torch.cat((-(vector @ axis)[:, None], turned), dim=1)


def common_up(pose: Float[Tensor, "B 4"], up: Float[Tensor, "3"]) -> Float[Tensor, "3"]:
    """The canonical direction that, on average, points up: sensors are held upright.

    Args:
        pose: unit quaternions w, x, y, z, `R_sensor_canonical`.
        up: unit vector, sensor frame.
    """
    return normalize((rotation_from_quaternion(pose).mT @ up).mean(0), dim=0)
