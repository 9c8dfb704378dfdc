# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The same encoder, trained through the winning points only (PERFORMANCE 3.2).

Max-pooling sends gradient through the arg-max points alone. A pass without a graph finds them, a
second pass with a graph runs on them only: the same code and the same gradient, several times
cheaper on a CPU. `tests/models/test_pcn_winners.py` proves it against `PCNEncoder.forward`.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import relu
from torch.profiler import record_function

from wildshape.models.pcn import PCNEncoder


def encode_winners(encoder: PCNEncoder, points: Float[Tensor, "B N 3"]) -> Float[Tensor, "B d"]:
    """`encoder(points)`, with a gradient to the weights; `points` get none."""
    with record_function("wildshape: encoder scoring"):
        pooled_row, code_row = _winning_rows(encoder, points)
    with record_function("wildshape: encoder winners"):
        return _code_of_winners(encoder, points, pooled_row, code_row)


def _code_of_winners(
    encoder: PCNEncoder,
    points: Float[Tensor, "B N 3"],
    pooled_row: Int[Tensor, "B b"],
    code_row: Int[Tensor, "B d"],
) -> Float[Tensor, "B d"]:
    """The encoder on the winning rows alone, with a graph."""
    count, size, _ = points.shape
    start = torch.arange(count, device=points.device)[:, None] * size
    rows = torch.cat((pooled_row + start, code_row + start), dim=1)
    active, position = torch.unique(rows, return_inverse=True)
    pooled_at, code_at = position.split((pooled_row.shape[1], code_row.shape[1]), dim=1)
    local = encoder.point2(relu(encoder.point1(points.reshape(-1, 3)[active])))
    pooled = local.gather(0, pooled_at)
    joined = encoder.join_point(local) + encoder.join_pooled(pooled)[active // size]
    code = _GatherDot.apply(relu(joined), encoder.point4.weight, code_at)
    return code + encoder.point4.bias  # pyright: ignore[reportOperatorIssue, reportReturnType]


@torch.no_grad()
def _winning_rows(
    encoder: PCNEncoder, points: Float[Tensor, "B N 3"]
) -> tuple[Int[Tensor, "B b"], Int[Tensor, "B d"]]:
    """Row of the maximum of each pooled feature and of each code entry, cloud by cloud.

    One cloud at a time keeps its activations in the cache.
    """
    weight3, weight4 = encoder.join_point.weight.T, encoder.point4.weight.T
    pooled_rows, code_rows = [], []
    for cloud in points:
        local = torch.addmm(encoder.point1.bias, cloud, encoder.point1.weight.T).relu_()
        local = torch.addmm(encoder.point2.bias, local, encoder.point2.weight.T)
        row = _argmax_rows(local)
        pooled = local.gather(0, row[None])
        bias = (encoder.join_pooled(pooled) + encoder.join_point.bias)[0]
        joined = torch.addmm(bias, local, weight3).relu_()
        pooled_rows.append(row)
        code_rows.append(_argmax_rows(joined @ weight4))
    return torch.stack(pooled_rows), torch.stack(code_rows)


def _argmax_rows(values: Float[Tensor, "n c"]) -> Int[Tensor, "c"]:
    """First row of each column's maximum: `amax` and a comparison, as torch's argmax is slow.

    The last row where the maximum is NaN: weights that are no longer finite give a loss that is
    not, and the trainer says so.
    """
    order = torch.arange(len(values), 0, -1, dtype=torch.int32, device=values.device)
    first = (values == values.amax(0)).int().mul_(order[:, None]).amax(0).clamp_min_(1)
    return (len(values) - first).long()


class _GatherDot(torch.autograd.Function):
    """`z[b, c] = u[row[b, c]] . W[c]`: the last layer at the winning rows alone."""

    @staticmethod
    def forward(ctx, u: Tensor, weight: Tensor, row: Tensor) -> Tensor:
        ctx.save_for_backward(u, weight, row)
        return torch.stack([(u.index_select(0, at) * weight).sum(1) for at in row])

    @staticmethod
    def backward(ctx, grad: Tensor):  # pyright: ignore[reportIncompatibleMethodOverride]
        u, weight, row = ctx.saved_tensors
        grad_u, grad_weight = torch.zeros_like(u), torch.zeros_like(weight)
        for at, g in zip(row, grad[..., None]):
            grad_weight.addcmul_(g.expand_as(weight), u.index_select(0, at))
            grad_u.index_add_(0, at, g * weight)
        return grad_u, grad_weight, None
