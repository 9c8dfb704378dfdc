# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility on the CPU by the compiled kernel of `native/zbuffer.c`."""

import torch
from jaxtyping import Bool, Float32, Int64
from torch import Tensor

from wildshape.ops.library import check_memory, library
from wildshape.ops.threads import exact_threads
from wildshape.ops.zbuffer.zbuffer_torch import check_bins


def visible_native(
    bins: Int64[Tensor, "B N"], depth: Float32[Tensor, "B N"], n_bins: int
) -> Bool[Tensor, "B N"]:
    """One pass over the points; the cost does not depend on `n_bins`.

    Raises:
        MemoryError: no room for the table of bins.
    """
    loaded = library()
    assert loaded is not None  # whoever calls has asked
    check_bins(bins, depth)
    check_memory("visible", bins, torch.int64)
    check_memory("visible", depth, torch.float32)
    bins, depth = bins.contiguous(), depth.contiguous()
    seen = torch.empty_like(bins, dtype=torch.bool)
    failed = loaded.wildshape_visible(
        bins.data_ptr(),
        depth.data_ptr(),
        *bins.shape,
        n_bins,
        seen.data_ptr(),
        exact_threads(),
    )
    if failed:
        raise MemoryError(f"no room for the bins of {bins.shape[1]} points.")
    return seen
