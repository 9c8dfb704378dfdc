# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points that hang together, and one a cell: compiled C, or scipy and numpy without a library."""

import numpy as np
from jaxtyping import Float32, Int32, Int64

from wildshape.ops.library import added_kernel

_NO_PAIRS = np.empty((0, 2), np.int64)


def connected_parts(
    points: Float32[np.ndarray, "n 3"],
    reach: float,
    cell: float,
    pairs: Int64[np.ndarray, "m 2"] = _NO_PAIRS,
) -> Int64[np.ndarray, "n"]:
    """A number for each point's part; parts are numbered by the first of their points.

    Args:
        points: all finite.
        reach: points of one part are joined by steps of at most this.
        cell: edge of cells of which the first point stands for all.
        pairs: rows of points that are one part however far apart they are.

    Raises:
        IndexError: a pair names a row that is not there.
        MemoryError: no room.
    """
    if pairs.size and not 0 <= pairs.min() <= pairs.max() < len(points):
        raise IndexError(f"a pair names a row outside of {len(points)} points.")
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    kernel = added_kernel("parts")
    if kernel is None:
        return connected_trees(points, reach, cell, pairs)
    part = np.empty(len(points), np.int64)
    dense, joined = np.ascontiguousarray(points, np.float32), np.ascontiguousarray(pairs, np.int64)
    given = dense.ctypes.data, len(dense), reach, cell, joined.ctypes.data, len(joined)
    if kernel(*given, part.ctypes.data):
        raise MemoryError(f"no room to join {len(points)} points.")
    return part


def connected_trees(
    points: Float32[np.ndarray, "n 3"],
    reach: float,
    cell: float,
    pairs: Int64[np.ndarray, "m 2"] = _NO_PAIRS,
) -> Int64[np.ndarray, "n"]:
    """The same by all pairs in reach."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    cells = np.floor(points / np.float32(cell))
    _, first, place = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    near = KDTree(points[first]).query_pairs(reach, output_type="ndarray")
    links = np.concatenate((near, place[pairs]))
    graph = coo_array((np.ones(len(links), bool), tuple(links.T)), shape=(len(first),) * 2)
    part = connected_components(graph, directed=False)[1][place]
    _, first, number = np.unique(part, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def first_of_cells(points: Float32[np.ndarray, "n 3"], cell: float) -> Int32[np.ndarray, "k"]:
    """The row of the first point in each cell that holds any, in rising order.

    Args:
        points: all finite.
        cell: edge of the cells.

    Raises:
        MemoryError: no room.
    """
    kernel = added_kernel("cells")
    if kernel is None:
        return first_sorted(points, cell)
    dense, rows = np.ascontiguousarray(points, np.float32), np.empty(len(points), np.int32)
    count = kernel(dense.ctypes.data, len(dense), cell, rows.ctypes.data)
    if count < 0:
        raise MemoryError(f"no room for the cells of {len(points)} points.")
    return rows[:count]


def first_sorted(points: Float32[np.ndarray, "n 3"], cell: float) -> Int32[np.ndarray, "k"]:
    """The same by sorting the cells."""
    cells = np.floor(points / np.float32(cell))
    return np.sort(np.unique(cells, axis=0, return_index=True)[1]).astype(np.int32)
