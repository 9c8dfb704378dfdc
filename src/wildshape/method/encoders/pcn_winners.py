# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The same encoder, trained through the winning points only.

Max-pooling sends gradient through the arg-max points alone. A pass without a graph finds them, a
second pass with a graph runs on them only: the same code and the same gradient, several times
cheaper on a CPU. Points that repeat, as they do where scans are resampled with replacement, are
scored once. `tests/method/encoders/test_pcn_winners.py` proves it against `PCNEncoder.forward`.
"""

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn.functional import relu
from torch.profiler import record_function

from wildshape.method.encoders.pcn import PCNEncoder
from wildshape.ops.column_argmax import column_argmax
from wildshape.ops.threads import spread

_ROWS, _FEATURES = 64, 32  # products of few sizes: each new one is prepared, which takes as long
_MIXERS = np.array((0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)).view(np.int64)


def encode_winners(
    encoder: PCNEncoder, points: Float[Tensor, "B N 3"], scoring: torch.dtype | None = None
) -> Float[Tensor, "B d"]:
    """`encoder(points)`, with a gradient to the weights; `points` get none.

    `scoring` is the type in which the last two layers are searched for their winners, by default
    that of the points. In bfloat16 a point within a rounding (1/256) of the maximum may win; the
    code is then that point's own value, in full precision.
    """
    with record_function("wildshape: encoder scoring"):
        pooled_row, code_row = _winning_rows(encoder, points, scoring or points.dtype)
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
    # Not `[...]`: its gradient is summed by all threads at once, in any order.
    joined = encoder.join_point(local) + encoder.join_pooled(pooled).index_select(0, active // size)
    return at_rows(encoder.point4, relu(joined), code_at)


def at_rows(
    layer: nn.Linear, inputs: Float[Tensor, "n u"], rows: Int[Tensor, "B c"]
) -> Float[Tensor, "B c"]:
    """`layer(inputs)[rows[b, c], c]`, with a gradient, of these rows alone."""
    found = _GatherDot.apply(inputs, layer.weight, rows)
    return found + layer.bias  # pyright: ignore[reportOperatorIssue, reportReturnType]


@torch.no_grad()
def _winning_rows(
    encoder: PCNEncoder, points: Float[Tensor, "B N 3"], scoring: torch.dtype
) -> tuple[Int[Tensor, "B b"], Int[Tensor, "B d"]]:
    """Row of the maximum of each pooled feature and of each code entry, cloud by cloud.

    One cloud at a time keeps its activations in the cache. Of equal points the first counts.
    """
    weight3, weight4 = (layer.weight.to(scoring) for layer in (encoder.join_point, encoder.point4))
    weight4 = weight4.T.contiguous()

    @torch.no_grad()  # each thread has a setting of its own
    def of_one(one: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
        cloud, rows = one
        distinct = torch.cat((rows, rows[:1].expand(-len(rows) % _ROWS)))
        local = torch.addmm(encoder.point1.bias, cloud[distinct], encoder.point1.weight.T).relu_()
        local = torch.addmm(encoder.point2.bias, local, encoder.point2.weight.T)
        row = column_argmax(local)
        pooled = local.gather(0, row[None])
        bias = (encoder.join_pooled(pooled) + encoder.join_point.bias).T
        joined = torch.addmm(bias.to(scoring), weight3, local.to(scoring).T).relu_()
        lit = _lit_first(joined)
        deep = joined.index_select(0, lit).T @ weight4.index_select(0, lit)
        return distinct[row], distinct[column_argmax(deep.to(local.dtype))]

    found = spread(of_one, zip(points, distinct_rows(points)))
    pooled_rows, code_rows = zip(*found)
    return torch.stack(pooled_rows), torch.stack(code_rows)


def _lit_first(joined: Float[Tensor, "c n"]) -> Int[Tensor, "k"]:
    """Features that any point lights, and a few that none does: the others add nothing."""
    most, feature = joined.amax(1).sort(descending=True)
    lit = int(most.count_nonzero())
    return feature[: lit + -lit % _FEATURES]


def distinct_rows(points: Float[Tensor, "B N 3"]) -> list[Int[Tensor, "n"]]:
    """The first row of each distinct point, ascending, cloud by cloud.

    Points are brought into the order of a hash of their bits, the row in its low bits, and compared
    with their neighbours: where two hashes collide a repetition may stay, and nothing is lost.
    """
    count = points.shape[1]
    rows = (1 << count.bit_length()) - 1
    array = points.contiguous().numpy()
    bits = array.view(f"i{array.itemsize}").astype(np.int64)
    key = (bits * _MIXERS).sum(-1) * _MIXERS[0] & ~rows | np.arange(count)
    order = np.sort(key, axis=1) & rows
    ordered = np.take_along_axis(array, order[..., None], axis=1)
    fresh = np.ones(order.shape, dtype=bool)
    fresh[:, 1:] = (ordered[:, 1:] != ordered[:, :-1]).any(-1)
    return [torch.from_numpy(np.sort(row[new])) for row, new in zip(order, fresh)]


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
