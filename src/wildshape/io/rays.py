# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Sight lines on disk: `rays/<scan>.npz` of a track folder (docs/formats.md)."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.io.atomic import atomic_write
from wildshape.io.guard import reading
from wildshape.io.scans.arrays import read_npz_arrays
from wildshape.io.scans.points import METRES, SENSOR_METRES, Coordinates
from wildshape.records import Points

_FEWEST = 20  # rays that tell
_FARTHER, _NEARER = 60.0, 30.0  # a cup in a hall: 31; of drives 5 % end before 2.8 times as far
_NEAR_M = 2.0  # or an object's diagonal; of 162 real and simulated scans a fifth of it at most

_NEEDED, _OPTIONAL = ("directions", "ranges"), "origins"


def read_rays(path: Path | str, coordinates: Coordinates = SENSOR_METRES) -> SightLines:
    """The rays in an `.npz` of `directions (m, 3)`, `ranges (m,)` and perhaps `origins (m, 3)`.

    `coordinates`: of ranges and origins on disk; here they are in metres and the sensor's frame.

    Raises:
        BadInputError: an array is missing, shapes do not fit, or they are no rays.
    """
    path = Path(path)
    with reading(path, "a numpy archive of rays"):
        found = read_npz_arrays(path, (*_NEEDED, _OPTIONAL))
        missing = [name for name in _NEEDED if name not in found]
        if missing:
            raise BadInputError(
                f"{path}: lacks {' and '.join(missing)}; save directions (m, 3) and ranges (m,)."
            )
        metres = METRES[coordinates.unit]
        ranges, origins = found["ranges"] * metres, found.get(_OPTIONAL)
        if origins is not None:
            origins = (origins - np.asarray(coordinates.origin)) * metres
        try:
            return SightLines(found["directions"], ranges, origins)
        except BadInputError as error:
            raise BadInputError(f"{path}: {error}") from error


def check_rays(rays: SightLines | None, scan: Points, name: str) -> None:
    """Refuse rays of another unit, or of another scan or frame: they say nothing of this object.

    `scan`: the returns of the object; both in one frame, metres. `name` is for the error.

    Raises:
        BadInputError: nearly all end 60 times as far away, most 30 times as near, or all pass by.
    """
    if rays is not None and len(rays) >= _FEWEST and len(scan):
        _check_unit(rays, scan, name)
        _check_near(rays, scan, name)


def _check_unit(rays: SightLines, scan: Points, name: str) -> None:
    came = rays.returned
    if len(came) < _FEWEST:
        return
    middle = ((scan.mean(0) - came.starts) ** 2).sum(1)
    away = np.sqrt(middle + scan.var(axis=0).sum())  # root mean square
    low, high = np.quantile(came.ranges / away, (0.05, 0.5))
    if low > _FARTHER or high < 1 / _NEARER:
        times = low if low > _FARTHER else high
        raise BadInputError(
            f"{name}: the rays end {times:.2g} times as far away as their object lies; give their"
            " ranges and origins in the unit of the scans."
        )


def _check_near(rays: SightLines, scan: Points, name: str) -> None:
    low, high = scan.min(0), scan.max(0)
    off = (low + high) / 2 - rays.starts
    along = np.maximum((off * rays.directions).sum(1), 0.0)
    nearest = float(np.linalg.norm(off - along[:, None] * rays.directions, axis=1).min())
    if nearest > max(float(np.linalg.norm(high - low)), _NEAR_M):
        raise BadInputError(
            f"{name}: no ray comes nearer than {nearest:.1f} m to the middle of the object; give"
            " the rays of the same scan, in its frame."
        )


def write_rays(path: Path | str, rays: SightLines) -> None:
    """Write rays as `.npz`, atomically, metres."""
    with atomic_write(path) as file:
        file.write(rays_bytes(rays))


def rays_bytes(rays: SightLines) -> bytes:
    """What a `.npz` of rays holds, metres."""
    known = {"directions": rays.directions, "ranges": rays.ranges, _OPTIONAL: rays.origins}
    arrays: dict[str, Any] = {name: value for name, value in known.items() if value is not None}
    file = BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()
