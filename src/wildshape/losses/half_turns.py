# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Half turns of a shape about its own axes: where images of an elongated shape mislead a pose.

Smoothed widely, a shape is an ellipsoid, and a pose and its half turns about the principal axes
give one image. A pose network that has settled for the wrong one does not leave it by descent.
"""

import torch
from jaxtyping import Float
from torch import Tensor


def half_turned(pose: Float[Tensor, "B 4"], axis: Float[Tensor, "B 3"]) -> Float[Tensor, "B 4"]:
    """The pose of the shape turned by 180 degrees about an axis of its own.

    Args:
        pose: unit quaternions w, x, y, z, `R_sensor_canonical`.
        axis: unit vectors, canonical frame.
    """
    scalar, vector = pose[:, :1], pose[:, 1:]
    turned = scalar * axis + torch.linalg.cross(vector, axis)
    return torch.cat((-(vector * axis).sum(1, keepdim=True), turned), dim=1)


def principal_axes(cloud: Float[Tensor, "B n 3"]) -> Float[Tensor, "B 3 3"]:
    """Unit vectors along which the points spread least, more and most, as rows."""
    centred = cloud - cloud.mean(1, keepdim=True)
    return torch.linalg.eigh(centred.mT @ centred).eigenvectors.mT


def some_half_turn(
    pose: Float[Tensor, "B 4"], cloud: Float[Tensor, "B n 3"], generator: torch.Generator
) -> Float[Tensor, "B 4"]:
    """Each pose turned about one of its shape's principal axes, drawn by `generator`."""
    axes = principal_axes(cloud.detach())
    drawn = torch.randint(3, (len(pose),), generator=generator).to(pose.device)
    rows = torch.arange(len(pose), device=pose.device)
    return half_turned(pose.detach(), axes[rows, drawn])
