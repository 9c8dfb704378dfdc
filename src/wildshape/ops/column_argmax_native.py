# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Row of the maximum of each column by the compiled kernel of `native/column_argmax.c`."""

import torch
from jaxtyping import Float32, Int64
from torch import Tensor

from wildshape.ops.library import library

WIDEST = -1


def column_argmax_native(values: Float32[Tensor, "n c"], level: int = WIDEST) -> Int64[Tensor, "c"]:
    """One pass over the values; `level` 0 is the portable form.

    Raises:
        RuntimeError: the library is not built.
    """
    loaded = library()
    if loaded is None:
        raise RuntimeError("the native library is not built; use the torch backend.")
    values = values.contiguous()
    row = torch.empty(values.shape[1], dtype=torch.int64)
    loaded.wildshape_column_argmax(values.data_ptr(), *values.shape, row.data_ptr(), level)
    return row
