# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which points of a cloud are kept: no outliers, evenly dense (METHOD 8), or so many (METHOD 2)."""

import math

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64


def statistical_inliers(
    points: Float[np.ndarray, "n 3"], neighbours: int = 20, ratio: float = 2.0
) -> Bool[np.ndarray, "n"]:
    """Points whose mean distance to their nearest neighbours is not unusual for this cloud.

    Kept where that mean is at most (average over the cloud) + `ratio` x (its standard deviation).

    Args:
        points: metres, any frame.
        neighbours: how many, the point itself not counted; fewer where the cloud is smaller.
        ratio: in standard deviations.
    """
    from scipy.spatial import KDTree

    k = min(neighbours, len(points) - 1)
    if k < 1:
        return np.ones(len(points), dtype=bool)
    distances, _ = KDTree(points).query(points, k=k + 1)
    means = distances[:, 1:].mean(axis=1)
    return means <= means.mean() + ratio * means.std()


def radius_inliers(
    points: Float[np.ndarray, "n 3"], radius: float, neighbours: int
) -> Bool[np.ndarray, "n"]:
    """Points with at least `neighbours` others within `radius` metres."""
    from scipy.spatial import KDTree

    if len(points) == 0:
        return np.ones(0, dtype=bool)
    counts = KDTree(points).query_ball_point(points, radius, return_length=True)
    return np.asarray(counts) - 1 >= neighbours


def thin(points: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "m 3"]:
    """At most `count` points, drawn without replacement, the same ones every time."""
    if len(points) <= count:
        return points
    keep = np.random.default_rng(0).choice(len(points), count, replace=False)
    return points[np.sort(keep)]


def voxel_thin(points: Float[np.ndarray, "n 3"], size: float) -> Float[np.ndarray, "m 3"]:
    """The mean of the points in each occupied cube of edge `size` metres, in a fixed order."""
    if len(points) == 0:
        return points
    _, index = np.unique(_cell_numbers(points, size), return_inverse=True)
    counts = np.bincount(index)
    sums = [np.bincount(index, weights=points[:, axis]) for axis in range(3)]
    return (np.stack(sums, axis=1) / counts[:, None]).astype(points.dtype)


def _cell_numbers(points: Float[np.ndarray, "n 3"], size: float) -> Int64[np.ndarray, "n"]:
    """A number for each point's cube, rising with x, then y, then z."""
    cells = np.floor(points / size).astype(np.int64)
    cells -= cells.min(axis=0)
    counts = [int(count) for count in cells.max(axis=0) + 1]
    if math.prod(counts) >= 2**63:  # tens of kilometres at centimetres
        return np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
    return np.asarray(np.ravel_multi_index(tuple(cells.T), tuple(counts)))


def sorted_points(points: Float32[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
    """The same points by z, y, x: sums over them then do not depend on the file's order.

    z and y are sorted as one whole number; x is looked at only where both are equal somewhere.
    """
    key = (ordered_bits(points[:, 2]) << 32) + ordered_bits(points[:, 1])
    order = np.argsort(key)
    ordered = key[order]
    tied = bool((ordered[1:] == ordered[:-1]).any())
    return points[np.lexsort(points.T)] if tied else points[order]


def ordered_bits(values: Float32[np.ndarray, "n"]) -> Int64[np.ndarray, "n"]:
    """Whole numbers of 32 bits, of either sign, in the order of the values."""
    bits = (values + np.float32(0)).view(np.int32)  # no -0
    return (bits ^ ((bits >> 31) & 0x7FFFFFFF)).astype(np.int64)


def value_of_bits(bits: Int64[np.ndarray, "n"]) -> Float32[np.ndarray, "n"]:
    """The values of which `ordered_bits` makes these."""
    return (bits ^ ((bits >> 31) & 0x7FFFFFFF)).astype(np.int32).view(np.float32)


def drawn(size: int, count: int) -> Int64[np.ndarray, "count"]:
    """Which of `size` ordered points a network sees: some of them, or all over and over."""
    if size > count:
        return np.random.default_rng(0).choice(size, count, replace=False)
    return np.arange(count) % size


def quantiles(
    rows: Float[np.ndarray, "k n"], shares: tuple[float, ...]
) -> Float[np.ndarray, "s k"]:
    """Those of each row at some shares of its length, between two values in proportion.

    What `numpy.quantile` gives, in a fraction of its time for some hundred values.
    """
    at = np.array(shares) * (rows.shape[1] - 1)
    below, above = np.floor(at).astype(int), np.ceil(at).astype(int)
    ordered = np.partition(rows, sorted({*below.tolist(), *above.tolist()}), axis=1)
    low, high = ordered[:, below], ordered[:, above]
    return (low + (high - low) * (at - below)).T
