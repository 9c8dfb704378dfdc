# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours on a GPU: one Triton kernel, no array of N x M.

`TRITON_INTERPRET=1` runs the same kernel on the CPU (slowly), which is how it is tested.
"""

import torch
import triton
import triton.language as tl
from jaxtyping import Float32, Int
from torch import Tensor

from wildshape.ops.nearest.neighbours import Neighbours, check_clouds


@triton.jit
def _search(
    query,
    target,
    query_sizes,
    target_sizes,
    squared,
    index,
    N,
    M,
    QUERIES: tl.constexpr,
    TARGETS: tl.constexpr,
):
    """One tile of queries of one cloud; each lane keeps its own minimum and the step it met it."""
    b = tl.program_id(1).to(tl.int64)
    i = tl.program_id(0) * QUERIES + tl.arange(0, QUERIES)
    inside = i < N
    count = tl.load(target_sizes + b)
    real = i < tl.load(query_sizes + b)
    at = query + b * N * 3 + i * 3
    x = tl.load(at, mask=inside, other=0.0)[:, None]
    y = tl.load(at + 1, mask=inside, other=0.0)[:, None]
    z = tl.load(at + 2, mask=inside, other=0.0)[:, None]
    lane = tl.arange(0, TARGETS)
    best = tl.full((QUERIES, TARGETS), float("inf"), tl.float32)
    step = tl.zeros((QUERIES, TARGETS), tl.int32)
    for start in range(0, M, TARGETS):
        j = start + lane
        here = target + b * M * 3 + j * 3
        dx = x - tl.load(here, mask=j < count, other=float("inf"))[None, :]
        dy = y - tl.load(here + 1, mask=j < count, other=float("inf"))[None, :]
        dz = z - tl.load(here + 2, mask=j < count, other=float("inf"))[None, :]
        d2 = dx * dx + dy * dy + dz * dz
        closer = d2 < best
        best = tl.where(closer, d2, best)
        step = tl.where(closer, start, step)
    least = tl.min(best, 1)
    # The smallest index among the lanes that attain the minimum.
    first = tl.min(tl.where(best == least[:, None], step + lane[None, :], M), 1)
    first = tl.where(least < float("inf"), first, 0)
    tl.store(squared + b * N + i, tl.where(real, least, 0.0), mask=inside)
    tl.store(index + b * N + i, tl.where(real, first, 0).to(tl.int64), mask=inside)


def nearest_triton(
    query: Float32[Tensor, "B N 3"],
    target: Float32[Tensor, "B M 3"],
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
) -> Neighbours:
    """Exact search on the tensors' own device."""
    check_clouds(query, target, query_sizes, target_sizes)
    (B, N), M = query.shape[:2], target.shape[1]
    squared = torch.empty(B, N, dtype=torch.float32, device=query.device)
    index = torch.empty(B, N, dtype=torch.int64, device=query.device)
    if B == 0 or N == 0:
        return Neighbours(squared, index)
    if query_sizes is None:
        query_sizes = torch.full((B,), N, device=query.device)
    if target_sizes is None:
        target_sizes = torch.full((B,), M, device=query.device)
    QUERIES, TARGETS = 64, 32
    _search[(triton.cdiv(N, QUERIES), B)](
        query.contiguous(),
        target.contiguous(),
        query_sizes.to(query.device).clamp(max=N).contiguous(),
        target_sizes.to(query.device).clamp(max=M).contiguous(),
        squared,
        index,
        N,
        M,
        QUERIES=QUERIES,  # pyright: ignore
        TARGETS=TARGETS,  # pyright: ignore
    )
    return Neighbours(squared, index)
