# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scans of a track agree on which way is front (METHOD 11.1, 12.1). Label-free.

What fails in single scans of a near-symmetric object is the half turn. Where the scans of a track
follow each other, the object does not turn around between them; that is seen from poses that turn
slowly, half turns aside. Where each scan was turned on its own, the track's mean shape is asked:
it knows front from back better than that of one scan.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.se3 import SE3

_NEIGHBOURS, _FEWEST, _SLOW_DEG = 5, 4, 15.0


def half_turn(middle_x: float, dtype: torch.dtype = torch.float64) -> SE3:
    """About the vertical through the middle of the object's length."""
    rotation = torch.diag(torch.tensor((-1.0, -1.0, 1.0), dtype=dtype))
    return SE3(rotation, torch.tensor((2 * middle_x, 0.0, 0.0), dtype=dtype))


def steady_signs(rotation: Float[Tensor, "V 3 3"]) -> Float[Tensor, "V"]:
    """+1 or -1 for each pose: turn those of -1 by a half turn and no neighbours are opposed.

    A problem of signs (Z2 synchronisation), solved by the leading eigenvector.
    """
    relative = rotation[:, None].mT @ rotation[None]
    cosine = (relative.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
    order = torch.arange(len(rotation))
    near = (order[:, None] - order).abs() <= _NEIGHBOURS
    eigenvector = torch.linalg.eigh(cosine * near).eigenvectors[:, -1]
    return torch.where(eigenvector < 0, -torch.ones_like(eigenvector), 1.0)


def slow(rotation: Float[Tensor, "V 3 3"]) -> bool:
    """Whether most neighbours are posed alike, half turns aside: the scans follow each other."""
    if len(rotation) < _FEWEST:
        return False
    flipped = rotation * rotation.new_tensor((-1.0, -1.0, 1.0))
    trace = torch.maximum(
        _trace(rotation[:-1].mT @ rotation[1:]), _trace(rotation[:-1].mT @ flipped[1:])
    )
    angle = torch.rad2deg(torch.acos(((trace - 1) / 2).clamp(-1, 1)))
    return float(angle.quantile(0.75)) < _SLOW_DEG


def _trace(matrix: Float[Tensor, "V 3 3"]) -> Float[Tensor, "V"]:
    return matrix.diagonal(dim1=-2, dim2=-1).sum(-1)


def voted_signs(
    rotation: Float[Tensor, "V 3 3"], gain: Float[Tensor, "V"], weights: Float[Tensor, "V"]
) -> Float[Tensor, "V"]:
    """+1 or -1 for each scan: turn those of -1 around, and all are posed one way.

    Args:
        rotation: `R_sensor_object`, as each scan found it.
        gain: by how much the track's shape costs more in a scan when turned around, metres.
        weights: how much each scan is worth.
    """
    if not slow(rotation):
        return torch.where(gain < 0, -torch.ones_like(gain), 1.0)
    signs = steady_signs(rotation)
    return signs if float((signs * weights).sum()) >= 0 else -signs
