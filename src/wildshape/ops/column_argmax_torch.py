# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Row of the maximum of each column by torch: `amax` and a comparison, as its argmax is slow."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor


def column_argmax_torch(values: Float[Tensor, "n c"]) -> Int64[Tensor, "c"]:
    """Several times faster than `values.argmax(0)` on a CPU (PERFORMANCE 0.3)."""
    order = torch.arange(len(values), 0, -1, dtype=torch.int32, device=values.device)
    first = (values == values.amax(0)).int().mul_(order[:, None]).amax(0).clamp_min_(1)
    return (len(values) - first).long()
