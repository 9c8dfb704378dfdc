# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A closed mesh around a completed shape, in its canonical frame.

The points are swollen until they touch, what is hidden from five of the six sides is filled (a
LiDAR never sees an underside), and the solid is worn down again by as much as it was swollen: until
its surface lies in the middle of the points around, which are a layer, not a sheet. That surface is
a level set, which marching cubes closes whatever the points are.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float

from wildshape.errors import BadInputError, MissingExtraError
from wildshape.ops.nearest import nearest

if TYPE_CHECKING:
    import trimesh

_CELLS = 96  # along the longest side
_REACH = 0.05  # of the longest side: what lies closer than twice that is joined
_SIDES = 5
_SMALLEST_BODY = 0.01  # of all cells inside
_MARGIN, _BAND = 3, 10  # cells
_AROUND, _ROUNDS = 0.015, 3  # of the longest side
_FEW = 0.02  # of the densest place: where there are fewer points, none are followed


class _Grid(NamedTuple):
    """Places in space, evenly apart."""

    places: Float[np.ndarray, "x y z 3"]
    start: Float[np.ndarray, "3"]
    step: float


def closed_mesh(points: Float[np.ndarray, "n 3"]) -> "trimesh.Trimesh":
    """The closed surface of a solid whose outside is where the points are.

    Args:
        points: complete shape, canonical frame (z up, mirror plane y = 0); any unit.

    Raises:
        BadInputError: the points have no extent.
        MissingExtraError: scikit-image is not installed.
    """
    import trimesh

    march = _marching_cubes()
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if not extent > 0:
        raise BadInputError("a shape whose points are all equal has no surface.")
    reach = _REACH * extent
    grid = _grid_around(points, extent / _CELLS, reach)
    depth = _depth(points, grid, reach, march)
    level = float(np.median(_interpolate(depth, grid, points)))
    depth = _centred(depth, grid, points, level)
    vertices, faces, *_ = march(_large_bodies(depth, level), level, gradient_direction="ascent")
    return trimesh.Trimesh(vertices * grid.step + grid.start, faces, process=False)


def _marching_cubes():
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise MissingExtraError(
            "meshes need scikit-image; install it with: pip install scikit-image"
        ) from error
    return marching_cubes


def _grid_around(points: np.ndarray, step: float, reach: float) -> _Grid:
    """A grid that holds the swollen points, the same on both sides of y = 0."""
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    high[1] = max(-low[1], high[1])
    low[1] = -high[1]
    count = np.ceil((high - low + 2 * reach) / step).astype(int) + 2 * _MARGIN
    start = (low + high) / 2 - (count - 1) * step / 2
    axes = [first + step * np.arange(n) for first, n in zip(start, count)]
    return _Grid(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), start, step)


def _depth(points: np.ndarray, grid: _Grid, reach: float, march) -> np.ndarray:
    """How far inside the filled, swollen solid each place is; 0 outside."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt

    apart = _distance(grid.places, points)
    swollen = apart < reach
    solid = np.asarray(binary_fill_holes(swollen | (_blocked_sides(swollen) >= _SIDES)))
    skin, *_ = march(np.where(solid & ~swollen, 0.0, apart), reach)
    depth = np.asarray(distance_transform_edt(solid)) * grid.step
    # Counted in cells near the surface that is sought would be stairs.
    close = solid & (np.abs(depth - reach) < _BAND * grid.step)
    depth[close] = _distance(grid.places[close], skin * grid.step + grid.start)
    return depth


def _centred(depth: np.ndarray, grid: _Grid, points: np.ndarray, level: float) -> np.ndarray:
    """The same with the points as deep as `level` in the mean of every neighbourhood."""
    from scipy.ndimage import gaussian_filter

    width = _AROUND * float(np.ptp(points, axis=0).max()) / grid.step
    cells = tuple(np.rint((points - grid.start) / grid.step).astype(int).T)
    number = np.zeros(depth.shape)
    np.add.at(number, cells, 1.0)
    number = gaussian_filter(number, width)
    few = _FEW * float(number.max())
    for _ in range(_ROUNDS):
        deeper = np.zeros(depth.shape)
        np.add.at(deeper, cells, _interpolate(depth, grid, points) - level)
        shift = gaussian_filter(deeper, width) / (number + few)
        depth = np.where(depth > 0, np.maximum(depth - shift, 0.0), 0.0)
    return depth


def _blocked_sides(filled: Bool[np.ndarray, "x y z"]) -> np.ndarray:
    """From how many of the six sides something filled hides each place."""
    count = np.zeros(filled.shape, np.int8)
    for axis in range(3):
        count += np.maximum.accumulate(filled, axis)
        count += np.flip(np.maximum.accumulate(np.flip(filled, axis), axis), axis)
    return count


def _distance(places: np.ndarray, points: np.ndarray) -> np.ndarray:
    query, target = (
        torch.from_numpy(np.ascontiguousarray(part.reshape(1, -1, 3), np.float32))
        for part in (places, points)
    )
    return nearest(query, target).distance_squared.sqrt().numpy().reshape(places.shape[:-1])


def _interpolate(field: np.ndarray, grid: _Grid, points: np.ndarray) -> np.ndarray:
    from scipy.ndimage import map_coordinates

    return map_coordinates(field, ((points - grid.start) / grid.step).T, order=1)


def _large_bodies(depth: np.ndarray, level: float) -> np.ndarray:
    """The field without bubbles, and without crumbs: bodies of less than a hundredth of all."""
    from scipy.ndimage import binary_fill_holes, label

    solid = np.asarray(binary_fill_holes(depth > level))
    depth = np.where(solid & (depth <= level), depth.max(), depth)
    found = label(solid)
    bodies = np.asarray(found[0])  # pyright: ignore[reportIndexIssue]
    size = np.bincount(bodies.ravel())
    crumbs = size < _SMALLEST_BODY * size[1:].sum()
    crumbs[0] = False
    return np.where(crumbs[bodies], 0.0, depth)
