# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PCN's code of clouds that repeat their points: each is computed once, for a maximum is the same.

A scan of fewer points than a network was trained on is given to it over and over. Vehicles at 40 m
have 100 points of 1,024.
"""

import torch
from jaxtyping import Float, Int64
from torch import Tensor
from torch.nn.functional import relu

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
    first = torch.arange(points.shape[1], device=points.device) < sizes[:, None]
    counts = sizes.tolist()
    local = encoder.point2(relu(encoder.point1(points[first])))
    pooled = torch.stack([part.amax(0) for part in local.split(counts)])
    joined = encoder.join_point(local)
    joined += encoder.join_pooled(pooled).repeat_interleave(sizes, 0)
    deep = encoder.point4(joined.relu_())
    return torch.stack([part.amax(0) for part in deep.split(counts)])
