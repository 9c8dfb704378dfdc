# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is handed in from Python as a scan."""

from collections.abc import Iterable, Mapping, Sequence, Set
from operator import attrgetter
from pathlib import Path

import numpy as np
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.box import spans
from wildshape.io.rays import check_rays, read_rays
from wildshape.io.scans.points import (
    LEAST_POINTS,
    check_near,
    check_one_object,
    check_repeats,
    drop_nonfinite,
    read_scan,
    without_origin,
)
from wildshape.records import Points, Sensor, SightLines, Track

_AXES = ("x", "y", "z")
_RAYS = ("directions", "ranges", "origins")
_OPEN3D_TENSOR = "point.positions"
_PLACES = ("xyz", "vertices", _OPEN3D_TENSOR, "points")


def as_points(scan: object, name: str = "scan") -> Points:
    """A scan handed in from Python as `(n, 3)` float32, finite, each place once, none the sensor's.

    Args:
        scan: an array or tensor, records with x, y, z, a path of a scan file, or an object that
            holds points: of laspy (`.xyz`), trimesh (`.vertices`), Open3D (`.points`,
            `.point.positions`), a `Completion`.
        name: for the error.

    Raises:
        BadInputError: not `(n, 3)`, fewer than 16 finite, different points, all points equal, over
            100 m or under 1 cm across, or farther than 1 km from the origin.
    """
    if isinstance(scan, str | Path):
        return read_scan(scan).points
    try:
        points = _unmasked(_coordinates(scan))
        if points.dtype.kind == "c":  # numpy would drop the imaginary parts
            raise TypeError("its numbers are complex")
        points = points if points.dtype.kind == "f" else points.astype(np.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"{name}: no array of numbers ({error}); pass (n, 3).") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInputError(
            f"{name}: expected points of shape (n, 3), found {points.shape};"
            " pass x, y, z columns in metres."
        )
    check_near(points, name)
    points = drop_nonfinite(without_origin(points)).points
    if len(points) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; at least {LEAST_POINTS} are needed."
        )
    if not spans(points).any():
        raise BadInputError(f"{name}: all {len(points)} points are equal; is the file damaged?")
    check_one_object(points, name)
    points = check_repeats(points, name)
    return np.require(points, requirements="W")  # torch warns of what may not be written


def each_of(scans: object, what: str = "scans") -> Sequence[object]:
    """Scans handed in from Python in whatever holds several, a generator, too.

    Args:
        scans: or what else there is one a scan of.
        what: they are called, for the error.

    Raises:
        BadInputError: it holds none in an order.
    """
    if isinstance(scans, str | Path | Mapping | Set) or not isinstance(scans, Iterable):
        cure = "; pass its .scans" if isinstance(scans, Track) else ""
        raise BadInputError(
            f"{what}: expected a list of {what}, found {type(scans).__name__}{cure}."
        )
    if getattr(scans, "ndim", 0) == 2:
        raise BadInputError(
            f"{what}: expected a list of {what}, found one array; put it in a list."
        )
    return scans if isinstance(scans, Sequence) else list(scans)


def all_as_points(scans: Iterable[object], first: int = 0) -> list[Points]:
    """Scans handed in from Python; errors count them from `first`."""
    return [as_points(scan, f"scan {i}") for i, scan in enumerate(each_of(scans), first)]


def _coordinates(scan: object) -> object:
    """What of an object is its points; the object itself if it is an array of some kind."""
    if isinstance(scan, Tensor):
        return _host(scan)
    for place in _PLACES:  # laspy's `points` are records, hence the order
        try:
            held = attrgetter(place)(scan)
        except (AttributeError, KeyError):
            continue
        return held.cpu().numpy() if place == _OPEN3D_TENSOR else held
    return scan


def _host(values: object) -> object:
    """A tensor in this machine's memory, without its gradient; anything else as it is."""
    return values.detach().cpu() if isinstance(values, Tensor) else values


def _unmasked(points: object) -> np.ndarray:
    """An array, NaN where it is masked; of records, as ROS hands them out, their x, y and z."""
    names = getattr(getattr(points, "dtype", None), "names", None) or ()
    if isinstance(points, np.ndarray) and set(_AXES) <= set(names):
        return np.stack([_unmasked(points[axis]) for axis in _AXES], axis=-1)
    if isinstance(points, np.ma.MaskedArray):
        return np.ma.filled(points.astype(np.float64), np.nan)
    return np.asarray(points)


def as_rays(rays: object, name: str = "rays") -> SightLines | None:
    """Rays handed in from Python; None for none.

    Args:
        rays: `SightLines`, a path of their file, a dict with `directions`, `ranges` and perhaps
            `origins`, or these in a tuple.
        name: for the error.

    Raises:
        BadInputError: they are no rays.
    """
    if rays is None or isinstance(rays, SightLines):
        return rays
    if isinstance(rays, str | Path):
        return read_rays(rays)
    if isinstance(rays, Mapping):
        rays = tuple(rays[key] for key in _RAYS if rays.get(key) is not None)
    if not isinstance(rays, tuple | list) or len(rays) not in (2, 3):
        raise BadInputError(f"{name}: expected directions (m, 3), ranges (m,) and perhaps origins.")
    try:
        return SightLines(*(np.asanyarray(_host(part)) for part in rays))  # masks stay
    except (TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"{name}: {str(error).removeprefix('rays: ')}") from error


def check_sensor(sensor: object) -> None:
    """Refuse what is handed in as a sensor and is none.

    Raises:
        BadInputError: neither None nor a `Sensor`.
    """
    if sensor is not None and not isinstance(sensor, Sensor):
        raise BadInputError(f"sensor: expected a wildshape.Sensor, found {sensor!r}.")


def rays_of_each(rays: object, scans: Sequence[object]) -> list[SightLines | None]:
    """`as_rays` of one set a scan, or of none: None, or no set.

    Raises:
        BadInputError: another number of sets than of scans, or no rays.
    """
    rays = () if rays is None else each_of(rays, "sets of rays")
    if len(rays) and len(rays) != len(scans):
        raise BadInputError(f"{len(rays)} sets of rays for {len(scans)} scans; give one a scan.")
    return [as_rays(one, f"rays {i}") for i, one in enumerate(rays)]


def together(
    scans: Iterable[object], rays: object, sensor: object
) -> tuple[list[Points], list[SightLines | None]]:
    """All scans of a track, and the rays beside each.

    Raises:
        BadInputError: they, or the sensor, cannot be used.
    """
    check_sensor(sensor)
    clouds = all_as_points(scans)
    known = rays_of_each(rays, clouds)
    check_all_rays(known, clouds)
    return clouds, known


def check_all_rays(
    rays: Sequence[SightLines | None], scans: Sequence[Points], first: int = 0
) -> None:
    """Refuse rays of another unit or scan; errors count them from `first`.

    Raises:
        BadInputError: see `check_rays`.
    """
    for i, (one, scan) in enumerate(zip(rays, scans), first):
        check_rays(one, scan, f"rays {i}")
