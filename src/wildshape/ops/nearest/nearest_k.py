# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The k nearest neighbours: compiled C on the CPU, trees without it, plain torch elsewhere."""

import math

import torch
from jaxtyping import Float, Int, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.ops.library import WIDEST, added_kernel, check_memory
from wildshape.ops.nearest.neighbours import Neighbourhoods, as_int64, beyond_sizes, check_clouds
from wildshape.ops.threads import exact_threads

_CHUNK_ELEMENTS = 1 << 22


def nearest_k_native(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    k: int,
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
    groups: tuple[Int64[Tensor, "B N"], Int64[Tensor, "B M"]] | None = None,
    most: float = math.inf,
    level: int = WIDEST,
) -> Neighbourhoods:
    """Blocks of targets out of reach are left out; `level` as in `nearest_native`.

    Raises:
        MemoryError: no room for one cloud's points a thread.
    """
    check_clouds(query, target, query_sizes, target_sizes)
    check_memory("nearest_k", query, torch.float32)
    check_memory("nearest_k", target, torch.float32)
    kernel = added_kernel("nearest_k")
    assert kernel is not None  # whoever calls has asked
    shape = (*query.shape[:2], k)
    squared = torch.empty(shape, dtype=torch.float32, device="cpu")
    found = Neighbourhoods(squared, torch.empty_like(squared, dtype=torch.int64))
    by_query, by_target = (None, None) if groups is None else groups
    sizes = as_int64(query_sizes), as_int64(target_sizes)
    given = (query, sizes[0], by_query, target, sizes[1], by_target)
    held = [None if part is None else part.contiguous() for part in given]
    failed = kernel(
        *(None if part is None else part.data_ptr() for part in held),
        len(query),
        query.shape[1],
        target.shape[1],
        k,
        most * most,
        found.distance_squared.data_ptr(),
        found.index.data_ptr(),
        exact_threads(),
        level,
    )
    if failed:
        raise MemoryError(f"no room to search {query.shape[1]} and {target.shape[1]} points.")
    return found


def nearest_k_trees(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    k: int,
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
    most: float = math.inf,
) -> Neighbourhoods:
    """By a k-d tree a cloud (scipy), on the CPU; all points finite. Ties come in any order."""
    from scipy.spatial import KDTree

    check_clouds(query, target, query_sizes, target_sizes)
    squared = torch.zeros(*query.shape[:2], k, dtype=query.dtype)
    index = torch.zeros(*query.shape[:2], k, dtype=torch.int64)
    for b, (points, others) in enumerate(zip(query, target)):
        n = len(points) if query_sizes is None else min(max(int(query_sizes[b]), 0), len(points))
        m = len(others) if target_sizes is None else min(max(int(target_sizes[b]), 0), len(others))
        tree = KDTree(others[:m].numpy().reshape(-1, 3), balanced_tree=False)
        apart, place = tree.query(points[:n].numpy(), k=k)
        found = torch.from_numpy(apart).view(n, k).to(query.dtype)
        near = found.square() <= most * most
        squared[b, :n] = torch.where(near, found.square(), math.inf)
        index[b, :n] = torch.where(near & found.isfinite(), torch.from_numpy(place).view(n, k), 0)
    return Neighbourhoods(squared, index)


def nearest_k_torch(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    k: int,
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
    groups: tuple[Int64[Tensor, "B N"], Int64[Tensor, "B M"]] | None = None,
    most: float = math.inf,
) -> Neighbourhoods:
    """All pairs, some queries at a time, in any floating type and on any device."""
    check_clouds(query, target, query_sizes, target_sizes)
    (B, N), M = query.shape[:2], target.shape[1]
    squared = query.new_full((B, N, k), math.inf)
    index = torch.zeros(B, N, k, dtype=torch.int64, device=query.device)
    gone = ~target.isfinite().all(-1)
    if target_sizes is not None:
        gone = gone | beyond_sizes(target, target_sizes)
    step = max(1, _CHUNK_ELEMENTS // max(B * M, 1))
    for start in range(0, N if M else 0, step):
        part = slice(start, start + step)
        d2 = (query[:, part, None] - target[:, None]).square().sum(-1)
        left_out = gone[:, None] | ~(d2 <= most * most)
        if groups is not None:
            left_out = left_out | (groups[0][:, part, None] == groups[1][:, None])
        least = d2.masked_fill(left_out, math.inf).topk(min(k, M), largest=False)
        squared[:, part, : least.values.shape[-1]] = least.values
        index[:, part, : least.values.shape[-1]] = least.indices
    index = index.masked_fill(squared.isinf(), 0)
    if query_sizes is None:
        return Neighbourhoods(squared, index)
    beyond = beyond_sizes(query, query_sizes)[..., None]
    return Neighbourhoods(squared.masked_fill(beyond, 0.0), index.masked_fill(beyond, 0))


def check_k(
    query: Tensor,
    target: Tensor,
    k: int,
    groups: tuple[Tensor, Tensor] | None,
) -> None:
    """Refuse what would be read past its end.

    Raises:
        BadInputError: k below 1, or groups that are not one whole number a point.
    """
    if k < 1:
        raise BadInputError(f"nearest_k: expected at least 1 neighbour, found {k}.")
    if groups is None:
        return
    for group, points in zip(groups, (query, target)):
        if group.shape != points.shape[:2] or group.dtype != torch.int64:
            raise BadInputError(
                f"nearest_k: expected {tuple(points.shape[:2])} int64 groups, found"
                f" {tuple(group.shape)} of {group.dtype}."
            )
