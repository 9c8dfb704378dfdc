# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The two terms that tie a posed shape to a scan (paper eq. 2 and 3, METHOD 4 and 5)."""

from jaxtyping import Bool, Float, Int, Int64
from torch import Tensor


def masked_mean(
    values: Float[Tensor, "B N"], counted: Bool[Tensor, "B N"] | Int64[Tensor, "B N"] | None
) -> Float[Tensor, "B"]:
    """Mean over the counted entries of each row, as often as counted; 0 where none is."""
    if counted is None:
        return values.mean(-1)
    weight = counted.to(values.dtype)
    return (values * weight).sum(-1) / weight.sum(-1).clamp_min(1.0)


_SMALLEST = 1e-12


def _distance_to(source: Tensor, target: Tensor, index: Tensor) -> Tensor:
    found = target.gather(1, index[..., None].expand(-1, -1, 3))
    return (source - found).square().sum(-1).clamp_min(_SMALLEST).sqrt()


def observation_term(
    scans: Float[Tensor, "B N 3"], posed: Float[Tensor, "B P 3"], to_shape: Int[Tensor, "B N"]
) -> Float[Tensor, "B"]:
    """`CD(X -> Y)`: every scan point lies on the shape. `to_shape` are known neighbours."""
    return _distance_to(scans, posed, to_shape).mean(-1)


def projection_term(
    posed: Float[Tensor, "B P 3"],
    scans: Float[Tensor, "B N 3"],
    to_scan: Int[Tensor, "B P"],
    visible: Bool[Tensor, "B P"],
) -> Float[Tensor, "B"]:
    """`CD(visible(Y) -> X)`: what the sensor would see of the shape, it did see.

    The gradient flows through the coordinates of the visible points, not through the choice.
    """
    return masked_mean(_distance_to(posed, scans, to_scan), visible)
