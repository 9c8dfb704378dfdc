# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A closed mesh around a completed shape, in its canonical frame, and how far it is believed.

The points are swollen until they touch, what is hidden from five of the six sides is filled (a
LiDAR never sees an underside), and the solid is worn down again by as much as it was swollen: until
its smoothed surface lies in the middle of the points around, which are a layer, not a sheet. That
surface is a level set, which marching cubes closes whatever the points are. Shapes that are alike
on both sides of their mirror plane get a mesh that is.

A place of the mesh is measured beside a scan's points, and guessed elsewhere.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from wildshape.errors import BadInputError, load_library
from wildshape.geometry.box import extent, unit_of
from wildshape.ops.nearest import nearest, nearest_k

if TYPE_CHECKING:
    import trimesh

_NEIGHBOUR, _MOST_TIMES = 4, 4.0  # a grid about a handful of points takes memory
_MARGIN = 3  # cells around the swollen points
_OFF_LEVEL = 1e-3  # of a cell: what keeps corners of the surface apart
_ALIKE = 1e-3  # of the longest side: so near to a point its reflection is one, too
_GUESSED_M, _GUESSED = 0.5, 0.65
# Blue to orange (Okabe & Ito's two, a light grey between): told apart by colour-blind readers.
_SCALE = np.array([(0, 114, 178), (196, 200, 206), (213, 94, 0)], np.float64)


@dataclass(frozen=True)
class MeshConfig:
    """How a mesh is made.

    Attributes:
        cells: of the grid along the longest side.
        reach: how far points are swollen, of the longest side: what lies closer than twice that is
            joined.
        sparse_reach: of few points, so many times the distance that 95 % of them have to their
            fourth neighbour, but no more than four times `reach`: a shell with holes has no inside.
        sides: from so many of six a place is hidden that lies inside: a LiDAR sees no underside.
        smallest_body: of all cells inside; smaller bodies are crumbs and left out.
        band: cells about the surface sought, in which depth is measured and not counted.
        smooth: of the longest side: width of the Gaussian that takes out what single points make.
        around: of the longest side: the neighbourhood in whose mean the surface is centred.
        rounds: of centring.
        few: of the densest place: where there are fewer points, none are followed.
        within: of the longest side: points so deep in the solid are not followed: seats behind
            glass.
    """

    cells: int = 96
    reach: float = 0.05
    sparse_reach: float = 1.6
    sides: int = 5
    smallest_body: float = 0.01
    band: int = 10
    smooth: float = 0.021
    around: float = 0.021
    rounds: int = 3
    few: float = 0.1
    within: float = 0.03


class _Grid(NamedTuple):
    """Places in space, evenly apart."""

    places: Float[np.ndarray, "x y z 3"]
    start: Float[np.ndarray, "3"]
    step: float


def closed_mesh(
    points: Float[np.ndarray, "n 3"], config: MeshConfig = MeshConfig()
) -> "trimesh.Trimesh":
    """The closed surface of a solid whose outside is where the points are.

    Args:
        points: complete shape, canonical frame (z up, mirror plane y = 0); any unit.
        config: see there.

    Raises:
        BadInputError: the points have no extent.
        MissingExtraError: scikit-image is not installed.
    """
    import trimesh

    measure = load_library(
        "skimage.measure", "meshes need scikit-image", "pip install scikit-image"
    )
    march = measure.marching_cubes
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    if not extent > 0:
        raise BadInputError("a shape whose points are all equal has no surface.")
    points = _on_both_sides(points, extent)
    reach = _reach(points, extent, config)
    grid = _grid_around(points, extent / config.cells, reach)
    depth = _depth(points, grid, reach, march, config)
    level = float(np.median(_interpolate(depth, grid, points)))
    depth = _centred(depth, grid, points, level, config)
    depth = _large_bodies(depth, level, config.smallest_body)
    depth = off_level(depth, level, _OFF_LEVEL * grid.step)
    vertices, faces, *_ = march(depth, level, gradient_direction="ascent")
    return trimesh.Trimesh(vertices * grid.step + grid.start, faces, process=False)


def off_level(
    depth: Float[np.ndarray, "x y z"], level: float, least: float
) -> Float[np.ndarray, "x y z"]:
    """The field with no value nearer to `level` than `least`, in the field's unit.

    A place at the level would be a corner of several cells' triangles, all at one point: a file of
    them is not closed.
    """
    return np.where(np.abs(depth - level) < least, level + least, depth)


def _on_both_sides(points: np.ndarray, extent: float) -> np.ndarray:
    """The points and their reflections in y = 0, where a quarter of them are reflections."""
    reflected = points * np.asarray((1, -1, 1), points.dtype)
    apart = np.quantile(_distance(reflected, points), 0.25)
    return np.concatenate((points, reflected)) if apart < _ALIKE * extent else points


def _reach(points: Float[np.ndarray, "n 3"], extent: float, config: MeshConfig) -> float:
    """How far points are swollen until they touch."""
    cloud = torch.from_numpy(np.ascontiguousarray(points, np.float32))[None]
    count = min(_NEIGHBOUR + 1, len(points))  # itself is one
    apart = nearest_k(cloud, cloud, count).distance_squared[0, :, -1].sqrt().numpy()
    least, sparse = config.reach * extent, config.sparse_reach * float(np.quantile(apart, 0.95))
    return min(max(least, sparse), _MOST_TIMES * least)


def _grid_around(points: np.ndarray, step: float, reach: float) -> _Grid:
    """A grid that holds the swollen points, the same on both sides of y = 0."""
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    high[1] = max(-low[1], high[1])
    low[1] = -high[1]
    count = np.ceil((high - low + 2 * reach) / step).astype(int) + 2 * _MARGIN
    start = (low + high) / 2 - (count - 1) * step / 2
    axes = [first + step * np.arange(n) for first, n in zip(start, count)]
    return _Grid(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), start, step)


def _depth(
    points: np.ndarray, grid: _Grid, reach: float, march: Any, config: MeshConfig
) -> np.ndarray:
    """How far inside the filled, swollen solid each place is, smoothed; 0 outside."""
    from scipy.ndimage import binary_fill_holes, distance_transform_edt, gaussian_filter

    apart = _distance(grid.places, points)
    swollen = apart < reach
    solid = np.asarray(binary_fill_holes(swollen | (_blocked_sides(swollen) >= config.sides)))
    skin, *_ = march(np.where(solid & ~swollen, 0.0, apart), reach)
    depth = np.asarray(distance_transform_edt(solid)) * grid.step
    # Counted in cells near the surface that is sought would be stairs.
    close = solid & (np.abs(depth - reach) < config.band * grid.step)
    depth[close] = _distance(grid.places[close], skin * grid.step + grid.start)
    return gaussian_filter(depth, config.smooth * config.cells)


def _centred(
    depth: np.ndarray, grid: _Grid, points: np.ndarray, level: float, config: MeshConfig
) -> np.ndarray:
    """The same with the points as deep as `level` in the mean of every neighbourhood."""
    from scipy.ndimage import gaussian_filter

    extent = float(np.ptp(points, axis=0).max())
    width = config.around * extent / grid.step
    points = points[_interpolate(depth, grid, points) < level + config.within * extent]
    cells = tuple(np.rint((points - grid.start) / grid.step).astype(int).T)
    number = np.zeros(depth.shape)
    np.add.at(number, cells, 1.0)
    number = gaussian_filter(number, width)
    few = config.few * float(number.max())
    for _ in range(config.rounds):
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


def _large_bodies(depth: np.ndarray, level: float, smallest: float) -> np.ndarray:
    """The field without bubbles, and without crumbs: bodies of less than that share of all."""
    from scipy.ndimage import binary_fill_holes, label

    solid = np.asarray(binary_fill_holes(depth > level))
    depth = np.where(solid & (depth <= level), depth.max(), depth)
    found = label(solid)
    bodies = np.asarray(found[0])  # pyright: ignore[reportIndexIssue]
    size = np.bincount(bodies.ravel())
    crumbs = size < smallest * size[1:].sum()
    crumbs[0] = False
    return np.where(crumbs[bodies], 0.0, depth)


def share_colours(shares: Float[np.ndarray, "n"]) -> UInt8[np.ndarray, "n 3"]:
    """One colour, red green blue, for each share of 0 to 1."""
    places = np.linspace(0.0, 1.0, len(_SCALE))
    columns = [np.interp(shares, places, _SCALE[:, i]) for i in range(3)]
    return np.stack(columns, axis=1).astype(np.uint8)


def place_confidence(
    places: Float[np.ndarray, "n 3"],
    scan: object,
    confidence: float,
    *,
    guessed_m: float = _GUESSED_M,
) -> Float[np.ndarray, "n"]:
    """The chance that each place of a vehicle lies within 20 cm of the true surface, roughly.

    Of smaller objects, with a smaller `guessed_m`, within as much less.

    1 on a measured point, falling linearly with the distance to any, to 0.65 times the completion's
    confidence at `guessed_m`.
    Of 120,000 places of 60 simulated cars, within 20 cm of the true surface are all that lie within
    10 cm of a measured point, and of those beyond half a metre six in ten (confidence 0.93).

    Args:
        places: in the scan's frame, metres.
        scan: the points measured, whatever numpy makes `(n, 3)` of; NaN are none.
        confidence: of the whole completion.
        guessed_m: from any measured point, beyond which a place is a guess, metres.

    Raises:
        BadInputError: not `(n, 3)`, or no point of the scan is finite; the others measured nothing.
    """
    try:
        measured = np.asarray(scan, np.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"scan: no array of numbers ({error}); pass (n, 3).") from error
    if measured.ndim != 2 or measured.shape[1] != 3:
        raise BadInputError(f"scan: expected points (n, 3), found {measured.shape}; pass x, y, z.")
    measured = measured[np.isfinite(measured).all(1)]
    if not len(measured):
        raise BadInputError("scan: no finite point; hand in the points that were completed.")
    # In double and about the middle of the scan: far from the sensor float32 counts in millimetres.
    middle = measured.mean(0)
    a, b = (torch.from_numpy((np.asarray(p) - middle)[None]).float() for p in (places, measured))
    apart = nearest(a, b).distance_squared[0].clamp_min(0).sqrt().numpy()
    return 1.0 - (1.0 - _GUESSED * confidence) * np.minimum(apart / guessed_m, 1.0)


def colour_by_confidence(mesh: "trimesh.Trimesh", scan: object, confidence: float) -> None:
    """Colour a mesh's vertices, blue for 1 to orange for 0; they get the attribute `confidence`.

    Of objects smaller than vehicles the distances are as much smaller (`unit_of`).
    """
    places = mesh.vertices.view(np.ndarray)
    guessed_m = _GUESSED_M * unit_of(extent(places))
    found = place_confidence(places, scan, confidence, guessed_m=guessed_m)
    visual: Any = mesh.visual
    visual.vertex_colors = share_colours(1.0 - found)
    mesh.vertex_attributes["confidence"] = found.astype(np.float32)
