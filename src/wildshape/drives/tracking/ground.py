# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How high above the ground each point of a scan is.

Patchwork++: Lee, Lim and Myung, IROS 2022. Each scan is taken on its own, so that the same scan
gives the same ground whichever came before it.
"""

import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.config import GroundConfig
from wildshape.errors import load_library
from wildshape.geometry.sampling import ordered_bits, value_of_bits
from wildshape.records import Points

_INSTALL = (
    "pip install pypatchworkpp (it has wheels for Linux on x86-64, macOS on arm64 and Windows;"
    " elsewhere it is built by a C++ compiler)"
)
_STDOUT = 1


def height_above_ground(
    points: Points, sensor_height_m: float, config: GroundConfig
) -> Float[np.ndarray, "n"]:
    """Metres above the ground under each point; 0 for ground, NaN out of range, or of reflections.

    Args:
        points: of a whole scan, level frame (z vertical, the sensor at the origin).
        sensor_height_m: above the ground.
        config: see there.

    Raises:
        MissingExtraError: Patchwork++ is not installed.
    """
    away = np.hypot(points[:, 0], points[:, 1])
    seen = (away > config.nearest_m) & (away < config.range_m)
    far_below = points[:, 2] < -sensor_height_m - config.below_m - config.steepest * away
    if far_below.sum() > config.reflected * len(points):
        seen &= ~far_below
    heights = np.full(len(points), np.nan)
    if not seen.any():
        return heights
    near = points.compress(seen, axis=0)  # four times as fast as points[seen]
    ground = np.zeros(len(near), bool)
    ground[_ground_rows(near, sensor_height_m, config)] = True
    reach = away[seen]
    highest = np.maximum(config.rise * sensor_height_m, config.slope * reach) - sensor_height_m
    ground &= (near[:, 2] < highest) | (reach > config.beside * sensor_height_m)
    floor = _floor(near, near.compress(ground, axis=0), sensor_height_m, config)
    heights[seen] = np.where(ground, 0.0, near[:, 2] - floor)
    return heights


def _ground_rows(
    points: Points, sensor_height_m: float, config: GroundConfig
) -> Int[np.ndarray, "g"]:
    pypatchworkpp = load_library("pypatchworkpp", "the ground is found by Patchwork++", _INSTALL)
    parameters = pypatchworkpp.Parameters()
    parameters.verbose = False
    parameters.enable_RNR = False  # wants intensities
    parameters.sensor_height = sensor_height_m
    parameters.min_range, parameters.max_range = config.nearest_m, config.range_m
    with _quiet():
        found = pypatchworkpp.patchworkpp(parameters)
    found.estimateGround(points)
    return np.asarray(found.getGroundIndices(), dtype=np.int64)


def _floor(
    points: Points, ground: Points, sensor_height_m: float, config: GroundConfig
) -> Float[np.ndarray, "n"]:
    """The ground's z under each point: the middle of its cell's, or of the nearest cell's."""
    from scipy.ndimage import distance_transform_edt

    if not len(ground):
        return np.full(len(points), -sensor_height_m)
    side = 2 * math.ceil(config.range_m / config.cell_m) + 1
    row = _cell(ground, side, config.cell_m)
    ordered = np.sort((row << 32) + ordered_bits(ground[:, 2]))
    counts = np.bincount(row, minlength=side * side)
    filled = np.flatnonzero(counts)
    middles = (np.cumsum(counts) - counts + counts // 2)[filled]
    floor = np.zeros(side * side)
    floor[filled] = value_of_bits(ordered[middles] - (filled << 32))
    empty = (counts == 0).reshape(side, side)
    nearest = distance_transform_edt(empty, return_distances=False, return_indices=True)
    x, y = np.asarray(nearest)
    return floor.reshape(side, side)[x, y].ravel()[_cell(points, side, config.cell_m)]


def _cell(points: Points, side: int, cell_m: float) -> Int[np.ndarray, "n"]:
    x, y = np.rint(points[:, :2].T / cell_m).astype(np.int64) + side // 2
    return x * side + y


@contextmanager
def _quiet() -> Iterator[None]:
    """Patchwork++ greets on stdout, where a command's result belongs."""
    if sys.stdout is not None:
        sys.stdout.flush()
    kept, nowhere = os.dup(_STDOUT), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, _STDOUT)
    try:
        yield
    finally:
        os.dup2(kept, _STDOUT)
        os.close(kept)
        os.close(nowhere)
