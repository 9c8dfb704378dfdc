# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The oriented box of a complete shape, upright in its canonical frame."""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.rotation import rotation_z

_ANGLES, _TRIM = 90, 0.002


class FittedBox(NamedTuple):
    """A box in the frame of the points it was fitted to.

    Attributes:
        centre: metres.
        size: full lengths along its own x, y, z, metres; x is the longer horizontal one.
        rotation: from box axes to the points' frame, a turn about z.
    """

    centre: Float[Tensor, "3"]
    size: Float[Tensor, "3"]
    rotation: Float[Tensor, "3 3"]


def fit_box(points: Float[Tensor, "n 3"]) -> FittedBox:
    """The upright rectangle of least area around all but the outermost 0.2 % at each side."""
    angles = torch.arange(_ANGLES, dtype=points.dtype) * (torch.pi / 2 / _ANGLES)
    turned = points @ rotation_z(angles)
    low, high = _trimmed_range(turned)
    size = high - low
    best = int((size[:, 0] * size[:, 1]).argmin())
    angle, centre, size = angles[best], (low[best] + high[best]) / 2, size[best]
    rotation = rotation_z(angle)
    position = rotation @ centre
    if size[1] > size[0]:
        rotation = rotation_z(angle + torch.pi / 2)
        size = size[torch.tensor((1, 0, 2))]
    if rotation[0, 0] < 0:
        rotation = rotation @ rotation_z(torch.tensor(torch.pi, dtype=points.dtype))
    return FittedBox(position, size, rotation)


def _trimmed_range(points: Float[Tensor, "a n 3"]) -> tuple[Tensor, Tensor]:
    outermost = int(_TRIM * points.shape[1]) + 1
    low = points.topk(outermost, dim=1, largest=False).values[:, -1]
    return low, points.topk(outermost, dim=1).values[:, -1]
