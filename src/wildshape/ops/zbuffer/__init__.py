# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility (METHOD 5): the one door. Backends lie beside it."""

from importlib.util import find_spec

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.ops.library import library
from wildshape.ops.zbuffer.zbuffer_native import visible_native
from wildshape.ops.zbuffer.zbuffer_torch import visible_reference


def visible(
    bins: Int64[Tensor, "B N"], depth: Float[Tensor, "B N"], n_bins: int
) -> Bool[Tensor, "B N"]:
    """Which points a sensor sees: in each occupied bin of its image the nearest alone.

    Args:
        bins: `(B, N)` bin of each point in its row's image; outside [0, n_bins): never visible.
        depth: `(B, N)` distance from the sensor, compared as float32; ties to the smallest
            index, NaN counts as infinitely far.
        n_bins: bins of one image.

    Returns:
        `(B, N)`: exactly one True for each occupied bin; no gradient.
    """
    depth = depth.detach().to(torch.float32)
    if bins.device.type == "cuda" and find_spec("triton"):
        from wildshape.ops.zbuffer.zbuffer_triton import visible_triton

        return visible_triton(bins, depth, n_bins)
    if bins.device.type == "cpu" and library():
        return visible_native(bins, depth, n_bins)
    return visible_reference(bins, depth, n_bins)
