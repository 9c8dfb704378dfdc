# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility in plain torch: the reference."""

import torch
from jaxtyping import Bool, Float32, Int64
from torch import Tensor

from wildshape.errors import BadInputError


def visible_reference(
    bins: Int64[Tensor, "B N"], depth: Float32[Tensor, "B N"], n_bins: int
) -> Bool[Tensor, "B N"]:
    """Order-independent minimum of (depth, index) packed into one int64 for each bin."""
    check_bins(bins, depth)
    B, N = bins.shape
    if bins.numel() == 0:
        return torch.zeros_like(bins, dtype=torch.bool)
    inside = (bins >= 0) & (bins < n_bins)
    rows = torch.arange(B, device=bins.device)[:, None]
    cells, count = (rows * n_bins + bins)[inside], B * n_bins
    if n_bins > 4 * N:  # number the occupied bins instead of clearing a mostly empty image
        cells, count = torch.unique(cells, return_inverse=True)[1], B * N
    packed = pack(depth)
    best = packed.new_full((count,), torch.iinfo(torch.int64).max)
    best.scatter_reduce_(0, cells, packed[inside], "amin")
    seen = torch.zeros_like(inside)
    seen[inside] = best[cells] == packed[inside]
    return seen


def pack(depth: Float32[Tensor, "B N"]) -> Int64[Tensor, "B N"]:
    """(depth, index in the row) as one int64 that sorts as the pair does."""
    depth = depth.nan_to_num(nan=torch.inf, posinf=torch.inf, neginf=-torch.inf) + 0.0  # no -0
    bits = depth.contiguous().view(torch.int32)
    ordered = bits ^ ((bits >> 31) & 0x7FFFFFFF)
    index = torch.arange(depth.shape[1], device=depth.device)
    return (ordered.to(torch.int64) << 32) | index


def check_bins(bins: Tensor, depth: Tensor) -> None:
    """Refuse what would be read past its end: types are checked under pytest alone.

    Raises:
        BadInputError: not a depth for each of `(B, N)` bins, or bins that are not int64.
    """
    if bins.ndim != 2 or bins.shape != depth.shape or bins.dtype != torch.int64:
        raise BadInputError(
            f"visible: expected int64 bins (B, N) and as many depths, found {tuple(bins.shape)} of"
            f" {bins.dtype} and {tuple(depth.shape)}."
        )
