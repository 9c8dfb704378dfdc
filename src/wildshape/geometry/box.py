# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The oriented box of a complete shape, upright in its canonical frame."""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.rotation import rotation_from_quaternion, rotation_z

# A box of edge 2 about the origin; its edges join corners that differ in one coordinate.
SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
EDGES = [(i, j) for i in range(8) for j in range(i) if np.abs(SIGNS[i] - SIGNS[j]).sum() == 2]
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


def box_axes(quaternion_wxyz: tuple[float, ...]) -> Float[np.ndarray, "3 3"]:
    """A box's own axes as columns, in the frame that its rotation leads to, float64."""
    return rotation_from_quaternion(torch.tensor(quaternion_wxyz, dtype=torch.float64)).numpy()


def fit_box(points: Float[Tensor, "n 3"]) -> FittedBox:
    """The upright rectangle of least area around all but the outermost 0.2 % at each side."""
    angles = torch.arange(_ANGLES, dtype=points.dtype) * (torch.pi / 2 / _ANGLES)
    low, high = _trimmed_range(_along_axes(points, angles))
    across = (high - low)[:-1].view(2, _ANGLES)
    best = int((across[0] * across[1]).argmin())
    axes = torch.tensor((best, _ANGLES + best, 2 * _ANGLES))
    angle, centre, size = angles[best], (low + high)[axes] / 2, (high - low)[axes]
    rotation = rotation_z(angle)
    position = rotation @ centre
    if size[1] > size[0]:
        rotation = rotation_z(angle + torch.pi / 2)
        size = size[torch.tensor((1, 0, 2))]
    if rotation[0, 0] < 0:
        rotation = rotation @ rotation_z(torch.tensor(torch.pi, dtype=points.dtype))
    return FittedBox(position, size, rotation)


def _along_axes(points: Float[Tensor, "n 3"], angles: Float[Tensor, "a"]) -> Tensor:
    """`(2 a + 1, n)`: along x at each angle, along y at each, and along z, which is the same."""
    cos, sin = angles.cos()[:, None], angles.sin()[:, None]
    x, y, z = points.T.contiguous()
    # No matrix product: its rounding depends on a point's place in the order.
    return torch.cat((x * cos + y * sin, y * cos - x * sin, z[None]))


def _trimmed_range(rows: Float[Tensor, "k n"]) -> tuple[Tensor, Tensor]:
    outermost = int(_TRIM * rows.shape[1]) + 1
    low = rows.topk(outermost, dim=1, largest=False).values[:, -1]
    return low, rows.topk(outermost, dim=1).values[:, -1]
