# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points that hang together: compiled C, or a k-d tree where there is no library."""

import numpy as np
from jaxtyping import Float32, Int64

from wildshape.ops.library import connected_kernel


def connected_parts(points: Float32[np.ndarray, "n 3"], reach: float) -> Int64[np.ndarray, "n"]:
    """A number for each point's part; parts are numbered by the first of their points.

    Args:
        points: all finite.
        reach: points of one part are joined by steps of at most this.

    Raises:
        MemoryError: no room.
    """
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    kernel = connected_kernel()
    part = connected_trees(points, reach) if kernel is None else np.empty(len(points), np.int64)
    if kernel is not None:
        dense = np.ascontiguousarray(points)
        if kernel(dense.ctypes.data, len(dense), reach, part.ctypes.data):
            raise MemoryError(f"no room to join {len(points)} points.")
    _, first, number = np.unique(part, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def connected_trees(points: Float32[np.ndarray, "n 3"], reach: float) -> Int64[np.ndarray, "n"]:
    """The same by all pairs in reach; the parts' numbers are in no order."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    pairs = KDTree(points).query_pairs(reach, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), bool), tuple(pairs.T)), shape=(len(points),) * 2)
    return connected_components(links, directed=False)[1].astype(np.int64)
