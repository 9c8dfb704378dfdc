# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours in plain torch: the reference, and a fast fallback for the CPU."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.neighbours import Neighbours

_CHUNK_ELEMENTS = 1 << 22


def nearest_reference(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    query_sizes: Int64[Tensor, "B"] | None = None,
    target_sizes: Int64[Tensor, "B"] | None = None,
) -> Neighbours:
    """Differences, squares, argmin: what the other backends must reproduce.

    Works in any floating type and on any device; queries are taken in chunks, so that memory
    stays below some ten MiB a cloud.
    """
    B, N, M = len(query), query.shape[1], target.shape[1]
    index = torch.zeros(B, N, dtype=torch.int64, device=query.device)
    squared = query.new_full((B, N), torch.inf)
    if B and N and M:
        step = max(1, _CHUNK_ELEMENTS // (B * M))
        for start in range(0, N, step):
            part = slice(start, start + step)
            d2 = (query[:, part, None] - target[:, None]).square().sum(-1)
            d2 = mask_targets(d2, target_sizes)
            # amin over (distance, index) spelled out: argmin promises no order among ties.
            best = d2.amin(-1, keepdim=True)
            order = torch.arange(M, device=d2.device).expand_as(d2)
            first = order.masked_fill(d2 != best, M).amin(-1)
            index[:, part], squared[:, part] = first.clamp_max(M - 1), best[..., 0]
    index = index.masked_fill(squared.isinf(), 0)
    return clear_padding(Neighbours(squared, index), query_sizes)


def mask_targets(
    d2: Float[Tensor, "B n M"], target_sizes: Int64[Tensor, "B"] | None
) -> Float[Tensor, "B n M"]:
    """Put padding targets out of reach."""
    if target_sizes is None:
        return d2
    padding = torch.arange(d2.shape[-1], device=d2.device) >= target_sizes[:, None]
    return d2.masked_fill(padding[:, None], torch.inf)


def clear_padding(found: Neighbours, query_sizes: Int64[Tensor, "B"] | None) -> Neighbours:
    """Padding queries get distance 0 and index 0."""
    if query_sizes is None:
        return found
    N = found.index.shape[1]
    padding = torch.arange(N, device=found.index.device) >= query_sizes[:, None]
    return Neighbours(
        found.distance_squared.masked_fill(padding, 0.0), found.index.masked_fill(padding, 0)
    )
