# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Row of the maximum of each column: the one door. Backends lie beside it."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.column_argmax_native import column_argmax_native
from wildshape.ops.column_argmax_torch import column_argmax_torch
from wildshape.ops.library import library


def column_argmax(values: Float[Tensor, "n c"]) -> Int64[Tensor, "c"]:
    """The first row of each column's maximum, `n >= 1`; no gradient.

    The last row where the column holds a NaN: weights that are no longer finite give a loss that
    is not, and the trainer says so.
    """
    values = values.detach()
    if values.device.type == "cpu" and values.dtype == torch.float32 and library():
        return column_argmax_native(values)
    return column_argmax_torch(values)
