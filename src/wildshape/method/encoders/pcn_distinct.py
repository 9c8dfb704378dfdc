# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PCN's code of clouds that repeat their points: each is computed once, for a maximum is the same.

A scan of fewer points than a network was trained on is given to it over and over. Vehicles at 40 m
have 100 points of 1,024.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.method.encoders.pcn import PCNEncoder


@torch.no_grad()
def encode_distinct(
    encoder: PCNEncoder, points: Float[Tensor, "B N 3"], sizes: Int64[Tensor, "B"]
) -> Float[Tensor, "B d"]:
    """The code of each cloud, no gradient.

    Args:
        encoder: its weights.
        points: clouds.
        sizes: points of each that come first; all others repeat one of them.
    """
    weight4 = encoder.point4.weight.T.contiguous()
    codes = [_code(encoder, cloud[:size], weight4) for cloud, size in zip(points, sizes.tolist())]
    return torch.stack(codes) + encoder.point4.bias


def _code(
    encoder: PCNEncoder, points: Float[Tensor, "n 3"], weight4: Float[Tensor, "c d"]
) -> Float[Tensor, "d"]:
    """Of one cloud, which keeps its features in the cache, without the last bias.

    Of the features before the last layer no point of a scan lights more than half; the others add
    nothing to any sum.
    """
    local = torch.addmm(encoder.point1.bias, points, encoder.point1.weight.T).relu_()
    local = torch.addmm(encoder.point2.bias, local, encoder.point2.weight.T)
    bias = encoder.join_pooled(local.amax(0)) + encoder.join_point.bias
    joined = torch.addmm(bias, local, encoder.join_point.weight.T).relu_()
    lit = joined.amax(0).nonzero()[:, 0]
    return (joined.index_select(1, lit) @ weight4.index_select(0, lit)).amax(0)
