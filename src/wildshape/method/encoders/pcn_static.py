# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The same encoder for a GPU: fixed shapes, winners found in the pass itself, products in bfloat16.

A recorded step allows no array whose size depends on values, so the winning points are not
gathered as on a CPU (`pcn_winners`). What is kept of it: the arg-max of each pooled layer, and a
gradient that enters through the winning rows alone, one row for each entry of the code.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import linear, relu

from wildshape.method.encoders.pcn import PCNEncoder


def encode_static(
    encoder: PCNEncoder, points: Float[Tensor, "B N 3"], inner: torch.dtype
) -> Float[Tensor, "B d"]:
    """`encoder(points)` with its gradient; `points` get none.

    Args:
        encoder: its weights stay in their own type.
        points: coordinates; the first layer, which sees them, is computed in their type.
        inner: of the products after the first layer; bfloat16 takes the matrix units.
    """
    lifted = relu(encoder.point1(points)).to(inner)
    local = _apply(encoder.point2, lifted)
    pooled = local.max(1).values
    joined = _apply(encoder.join_point, local) + _apply(encoder.join_pooled, pooled)[:, None]
    best = LinearMax.apply(relu(joined), encoder.point4.weight)
    return best + encoder.point4.bias  # pyright: ignore[reportOperatorIssue, reportReturnType]


def _apply(layer: nn.Linear, x: Tensor) -> Tensor:
    """A layer in the type of what comes in."""
    bias = None if layer.bias is None else layer.bias.to(x.dtype)
    return linear(x, layer.weight.to(x.dtype), bias)


class LinearMax(torch.autograd.Function):
    """`max_n u[b, n] . W[c]`: a linear layer and the maximum over the points of a cloud.

    The `(B, N, d)` products are not kept for the gradient, only the row of each maximum: of equal
    products the first. The gradient puts each entry on its row and multiplies: no two entries
    share a place, so nothing is added up in an order that changes from run to run.
    """

    @staticmethod
    def forward(
        ctx, u: Float[Tensor, "B N c"], weight: Float[Tensor, "d c"]
    ) -> Float[Tensor, "B d"]:
        """The maxima in the type of the weight."""
        best = linear(u, weight.to(u.dtype)).max(1)
        ctx.save_for_backward(u, weight, best.indices)
        return best.values.to(weight.dtype)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx, grad: Float[Tensor, "B d"]
    ) -> tuple[Tensor, Tensor]:
        """Through the winning rows alone."""
        u, weight, row = ctx.saved_tensors
        placed = u.new_zeros(*u.shape[:2], len(weight))
        placed.scatter_(1, row[:, None], grad[:, None].to(u.dtype))
        to_weight = placed.flatten(0, 1).mT @ u.flatten(0, 1)
        return placed @ weight.to(u.dtype), to_weight.to(weight.dtype)
