# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility on a GPU: 64-bit atomic minimum of (depth, index) a bin."""

import torch
import triton
import triton.language as tl
from jaxtyping import Bool, Float32, Int64
from torch import Tensor

from wildshape.ops.zbuffer.zbuffer_torch import check_bins, pack


@triton.jit
def _minimum(bins, packed, nearest, N, n_bins, total, POINTS: tl.constexpr):
    """Scatter by atomic minimum: the order of arrival does not matter."""
    i = tl.program_id(0).to(tl.int64) * POINTS + tl.arange(0, POINTS)
    inside = i < total
    bin_ = tl.load(bins + i, mask=inside, other=-1)
    inside = inside & (bin_ >= 0) & (bin_ < n_bins)
    key = tl.load(packed + i, mask=inside, other=0)
    tl.atomic_min(nearest + (i // N) * n_bins + bin_, key, mask=inside)


@triton.jit
def _compare(bins, packed, nearest, seen, N, n_bins, total, POINTS: tl.constexpr):
    """A point is seen where its own key won its bin."""
    i = tl.program_id(0).to(tl.int64) * POINTS + tl.arange(0, POINTS)
    inside = i < total
    bin_ = tl.load(bins + i, mask=inside, other=-1)
    valid = inside & (bin_ >= 0) & (bin_ < n_bins)
    key = tl.load(packed + i, mask=valid, other=0)
    won = tl.load(nearest + (i // N) * n_bins + bin_, mask=valid, other=1)
    tl.store(seen + i, (valid & (key == won)).to(tl.uint8), mask=inside)


def visible_triton(
    bins: Int64[Tensor, "B N"], depth: Float32[Tensor, "B N"], n_bins: int
) -> Bool[Tensor, "B N"]:
    """Memory of B images of `n_bins` int64 each, on the tensors' own device."""
    check_bins(bins, depth)
    B, N = bins.shape
    seen = torch.zeros(B, N, dtype=torch.uint8, device=bins.device)
    if bins.numel() == 0:
        return seen.bool()
    bins, packed, POINTS = bins.contiguous(), pack(depth), 256
    limit = torch.iinfo(torch.int64).max
    nearest = torch.full((B * n_bins,), limit, dtype=torch.int64, device=bins.device)
    grid = (triton.cdiv(B * N, POINTS),)
    _minimum[grid](bins, packed, nearest, N, n_bins, B * N, POINTS=POINTS)  # pyright: ignore
    _compare[grid](bins, packed, nearest, seen, N, n_bins, B * N, POINTS=POINTS)  # pyright: ignore
    return seen.bool()
