# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Neighbours within one cloud, for encoders that look at neighbourhoods.

Scans are resampled with replacement: a point may stand in a cloud several times. Its copies are
no neighbours of anything, so that a code depends on which points there are, and not on how often
or in which order they come.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor


@torch.no_grad()
def first_copies(points: Float[Tensor, "B N 3"]) -> Bool[Tensor, "B N"]:
    """Whether no earlier point of the cloud is the same."""
    x, y, z = points.unbind(-1)
    same = x[:, :, None] == x[:, None]
    same = same & (y[:, :, None] == y[:, None]) & (z[:, :, None] == z[:, None])
    first = same.to(torch.uint8).argmax(-1)
    return first == torch.arange(points.shape[1], device=points.device)


@torch.no_grad()
def nearest_distinct(
    queries: Float[Tensor, "B S c"],
    places: Float[Tensor, "B N c"],
    distinct: Bool[Tensor, "B N"],
    count: int,
) -> Int[Tensor, "B S k"]:
    """The `count` nearest distinct places of each query, nearest first; no gradient.

    Where there are fewer the nearest is repeated, which no maximum notices.
    """
    products = queries @ places.mT
    squared = places.square().sum(-1)[:, None] - 2 * products  # the query's own length is constant
    squared = squared.masked_fill(~distinct[:, None], torch.inf)
    found = squared.topk(min(count, places.shape[1]), largest=False)
    return torch.where(found.values.isfinite(), found.indices, found.indices[..., :1])


def rows_of(features: Float[Tensor, "B N c"], index: Int[Tensor, "B S k"]) -> Tensor:
    """Features `(B, S, k, c)` of neighbours, differentiable."""
    flat = index.flatten(1)[..., None].expand(-1, -1, features.shape[-1])
    return features.gather(1, flat).unflatten(1, index.shape[1:])
