# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Row of the maximum of each column, by torch or by the compiled kernel."""

import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.ops.library import WIDEST, check_memory, library


def column_argmax(values: Float[Tensor, "n c"]) -> Int64[Tensor, "c"]:
    """The first row of each column's maximum, `n >= 1`; no gradient.

    The last row where the column holds a NaN: weights that are no longer finite give a loss that
    is not, and the trainer says so.
    """
    values = values.detach()
    if values.device.type == "cpu" and values.dtype == torch.float32 and library():
        return column_argmax_native(values)
    return column_argmax_torch(values)


def column_argmax_torch(values: Float[Tensor, "n c"]) -> Int64[Tensor, "c"]:
    """Several times faster than `values.argmax(0)` on a CPU."""
    order = torch.arange(len(values), 0, -1, dtype=torch.int32, device=values.device)
    first = (values == values.amax(0)).int().mul_(order[:, None]).amax(0).clamp_min_(1)
    return (len(values) - first).long()


def column_argmax_native(values: Float32[Tensor, "n c"], level: int = WIDEST) -> Int64[Tensor, "c"]:
    """One pass over the values; `level` 0 is the portable form.

    Raises:
        BadInputError: not a matrix of float32 with a row.
    """
    loaded = library()
    assert loaded is not None  # whoever calls has asked
    check_memory("column_argmax", values, torch.float32)
    if values.ndim != 2 or not 0 < len(values) < 2**31:
        raise BadInputError(f"column_argmax: expected (n, c) with n >= 1, found {values.shape}.")
    values = values.contiguous()
    row = values.new_empty(values.shape[1], dtype=torch.int64)
    loaded.wildshape_column_argmax(values.data_ptr(), *values.shape, row.data_ptr(), level)
    return row
