# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours in plain torch: the reference, and the fast form without a compiler."""

import torch
from jaxtyping import Float, Float32, Int, Int64
from torch import Tensor

from wildshape.ops.nearest.neighbours import Neighbours, beyond_sizes, check_clouds

_CHUNK_ELEMENTS = 1 << 19  # 2 MiB of float32: stays in the cache
_BLOCK = 32


def nearest_reference(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
) -> Neighbours:
    """Differences, squares, minimum: what the other backends must reproduce.

    Works in any floating type and on any device; queries are taken in chunks, never all pairs.
    """
    check_clouds(query, target, query_sizes, target_sizes)
    (B, N), M = query.shape[:2], target.shape[1]
    query, broken = _without_broken(query)
    index = torch.zeros(B, N, dtype=torch.int64, device=query.device)
    squared = query.new_full((B, N), torch.inf)
    if B and N and M:
        target = _far_away(target, target_sizes)
        step = max(1, _CHUNK_ELEMENTS // (B * M))
        for start in range(0, N, step):
            part = slice(start, start + step)
            d2 = (query[:, part, None] - target[:, None]).square().sum(-1)
            squared[:, part], index[:, part] = _first_minimum(d2)
    return _cleared(Neighbours(squared, index), broken, query_sizes)


def nearest_blocked(
    query: Float32[Tensor, "B N 3"],
    target: Float32[Tensor, "B M 3"],
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
) -> Neighbours:
    """The same in far fewer passes: `amin` is some 20 times faster than `argmin` on a CPU.

    The minimum of each block of 32 targets by `amin`, then only the winning block again. Exact
    like the reference; needs no compiler.
    """
    (B, N), M = query.shape[:2], target.shape[1]
    if not (B and N and M):
        return nearest_reference(query, target, query_sizes, target_sizes)
    check_clouds(query, target, query_sizes, target_sizes)
    query, broken = _without_broken(query)
    target = _far_away(target, target_sizes)
    target = torch.nn.functional.pad(target, (0, 0, 0, -M % _BLOCK), value=torch.inf)
    block = torch.empty(B, N, dtype=torch.int64, device=query.device)
    step = max(1, _CHUNK_ELEMENTS // target.shape[1])
    for b in range(B):
        axes = query[b].T.contiguous()
        for start in range(0, N, step):
            part = slice(start, start + step)
            block[b, part] = _winning_block(axes[:, part], target[b])
    found = _search_block(query, target.view(B, -1, _BLOCK, 3), block)
    return _cleared(found, broken, query_sizes)


def _winning_block(axes: Float[Tensor, "3 n"], target: Float[Tensor, "M 3"]) -> Int64[Tensor, "n"]:
    """The first block of targets that holds each query's minimum; queries in the inner axis."""
    d2 = _squared_distance(axes[:, None].unbind(), target[..., None].unbind(1))
    least = d2.view(-1, _BLOCK, axes.shape[1]).amin(1)
    return _first_minimum(least.T)[1]


def _search_block(
    query: Float[Tensor, "B N 3"], blocks: Float[Tensor, "B K k 3"], block: Int64[Tensor, "B N"]
) -> Neighbours:
    """Distances to one block a query, a bounded number of queries at a time."""
    first = torch.arange(len(query), device=query.device)[:, None] * blocks.shape[1]
    rows, points = (block + first).flatten(), query.reshape(-1, 3)
    axes = blocks.mT.reshape(-1, 3, _BLOCK)  # a block's targets in the inner axis
    squared, index = torch.empty_like(points[:, 0]), torch.empty_like(rows)
    step = _CHUNK_ELEMENTS // (4 * _BLOCK)
    for start in range(0, len(rows), step):
        part = slice(start, start + step)
        chosen = axes.index_select(0, rows[part])
        d2 = _squared_distance(points[part, :, None].unbind(1), chosen.unbind(1))
        squared[part], index[part] = _first_minimum(d2)
    index = (block.flatten() * _BLOCK + index).masked_fill(squared.isinf(), 0)
    return Neighbours(squared.view_as(block), index.view_as(block))


def _squared_distance(a: tuple[Tensor, ...], b: tuple[Tensor, ...]) -> Tensor:
    """Sum of squared differences, an axis (x, y, z) at a time and mostly in place."""
    d2 = (a[0] - b[0]).square_()
    for p, q in zip(a[1:], b[1:]):
        difference = p - q
        d2.addcmul_(difference, difference)
    return d2


def _first_minimum(d2: Float[Tensor, "*any M"]) -> tuple[Tensor, Tensor]:
    """Minimum along the last axis and the first place that attains it (argmin promises none)."""
    least = d2.amin(-1)
    order = torch.arange(d2.shape[-1], dtype=torch.int32, device=d2.device)
    index = torch.where(d2 == least[..., None], order, d2.shape[-1]).amin(-1)
    return least, torch.where(least < torch.inf, index, 0).to(torch.int64)


def _without_broken(query: Float[Tensor, "B N 3"]) -> tuple[Tensor, Tensor]:
    """Queries with zeros for those that are not finite, and `(B, N)`: which these are."""
    broken = ~query.isfinite().all(-1)
    return query.masked_fill(broken[..., None], 0.0), broken


def _far_away(
    target: Float[Tensor, "B M 3"], sizes: Int[Tensor, "B"] | None
) -> Float[Tensor, "B M 3"]:
    """Put targets infinitely far away that are padding or not finite."""
    gone = ~target.isfinite().all(-1)
    if sizes is not None:
        gone = gone | beyond_sizes(target, sizes)
    return target.masked_fill(gone[..., None], torch.inf)


def _cleared(found: Neighbours, broken: Tensor, sizes: Int[Tensor, "B"] | None) -> Neighbours:
    """Broken queries get distance inf, padding queries 0; both index 0."""
    squared, index = found.distance_squared, found.index
    squared, index = squared.masked_fill(broken, torch.inf), index.masked_fill(broken, 0)
    if sizes is None:
        return Neighbours(squared, index)
    beyond = beyond_sizes(index, sizes)
    return Neighbours(squared.masked_fill(beyond, 0.0), index.masked_fill(beyond, 0))
