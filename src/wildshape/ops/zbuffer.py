# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility (METHOD 5): the one door. Backends lie beside it."""

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.ops.zbuffer_torch import visible_reference


def visible(
    bins: Int64[Tensor, "B N"], depth: Float[Tensor, "B N"], n_bins: int
) -> Bool[Tensor, "B N"]:
    """Which points a sensor sees: in each occupied bin of its image the nearest alone.

    Args:
        bins: `(B, N)` bin of each point in its row's image; outside [0, n_bins): never visible.
        depth: `(B, N)` distance from the sensor, compared as float32; ties to the smallest index.
        n_bins: bins of one image.

    Returns:
        `(B, N)`: exactly one True for each occupied bin; no gradient.
    """
    return visible_reference(bins, depth.detach().to(torch.float32), n_bins)
