# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How far points reach along level directions: compiled C, or numpy where there is no library."""

import numpy as np
from jaxtyping import Float, Float64

from wildshape.ops.library import added_kernel


def spans(
    points: Float[np.ndarray, "n 3"], directions: Float64[np.ndarray, "2 a"]
) -> tuple[Float64[np.ndarray, "a"], Float64[np.ndarray, "a"]]:
    """The least and the greatest coordinate of points along directions; both backends are equal.

    Args:
        points: at least one; taken as float32.
        directions: their x, then their y.
    """
    kernel = added_kernel("spans")
    if kernel is None:
        return spans_numpy(points, directions)
    dense, level = (
        np.ascontiguousarray(part, kind)
        for part, kind in ((points, np.float32), (directions, np.float64))
    )
    count = level.shape[1]
    found = np.empty((2, count))
    least, most = found
    kernel(
        dense.ctypes.data, len(dense), level.ctypes.data, count, least.ctypes.data, most.ctypes.data
    )
    return least, most


def spans_numpy(
    points: Float[np.ndarray, "n 3"], directions: Float64[np.ndarray, "2 a"]
) -> tuple[Float64[np.ndarray, "a"], Float64[np.ndarray, "a"]]:
    """The same; no product of matrices, for which BLAS would wake its threads."""
    x, y = points[:, :2].T.astype(np.float32).astype(np.float64)
    along = directions[0][:, None] * x + directions[1][:, None] * y
    return along.min(1), along.max(1)
