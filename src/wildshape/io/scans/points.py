# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The door to scan files: points by suffix, in metres and the sensor's frame, and checked."""

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Float32

from wildshape.arguments import as_path, check_fields, expect
from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.scans.arrays import read_kitti_bin, read_npy, read_npz
from wildshape.io.scans.las import read_las
from wildshape.io.scans.pcd import read_pcd
from wildshape.io.scans.ply import read_ply
from wildshape.io.scans.text import header_unit, read_text
from wildshape.records import Unit

_READERS: dict[str, tuple[str, Callable[[Path], Float[np.ndarray, "n 3"]]]] = {
    ".ply": ("a PLY file", read_ply),
    ".pcd": ("a PCD file", read_pcd),
    ".bin": ("a KITTI scan (float32 x y z intensity)", read_kitti_bin),
    ".npy": ("a numpy array (n, 3)", read_npy),
    ".npz": ("a numpy archive with an array (n, 3)", read_npz),
    ".xyz": ("text with x y z a line", read_text),
    ".txt": ("text with x y z a line", read_text),
    ".csv": ("text with x y z a line", read_text),
    ".las": ("a LAS file", read_las),
    ".laz": ("a LAZ file", read_las),
}
SUFFIXES = tuple(_READERS)
"""The suffixes of scan files, in lower case."""


LEAST_POINTS = 16
"""Finite points that a scan has at least."""
LARGEST_EXTENT_M = 100.0
"""No command takes a larger scan."""
_SMALLEST_EXTENT = 0.01
_FARTHEST = 1000.0
_ENOUGH = 10_000  # points that tell where a scan lies
_COARSEST_M = 0.005
_FLOAT32_STEP = 2.0**-24  # half of what two neighbouring numbers of float32 differ by, relatively

Place = tuple[float, float, float]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True)
class Coordinates:
    """How files are to be read.

    Attributes:
        unit: of their numbers.
        origin: the sensor's position in the files' own frame and unit, for scans that were moved
            into a map; subtracted before anything is rounded to float32.
    """

    unit: Unit = "m"
    origin: Place = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.unit not in METRES:
            raise BadInputError(f"unit '{self.unit}' is unknown; use one of {', '.join(METRES)}.")
        check_fields(self)

    @property
    def moved(self) -> bool:
        """Whether the files are not in their sensor's frame."""
        return any(self.origin)

    def in_unit(self, unit: Unit) -> "Coordinates":
        """The same in the unit that a file names, unless the user has said another than `m`."""
        return replace(self, unit=unit) if self.unit == "m" else self

    def agreeing(self, unit: Unit | None, path: Path) -> "Coordinates":
        """The same in the unit that a scan's own header names, which no other may contradict.

        Raises:
            BadInputError: the user or track.json has said another than `m`.
        """
        if unit is not None and self.unit not in ("m", unit):
            raise BadInputError(
                f"{path}: its header gives the coordinates in {unit}, but --unit or track.json says"
                f" {self.unit}; leave that away."
            )
        return replace(self, unit=unit or self.unit)

    def to_sensor(self, points: Float[np.ndarray, "n 3"], path: Path) -> Float[np.ndarray, "n 3"]:
        """Points of a file in its sensor's frame, metres, in the precision that they have.

        Raises:
            BadInputError: the file itself was rounded so coarsely that no origin can cure it.
        """
        if self == SENSOR_METRES:
            return points
        exact = points.astype(np.float64)
        if self.moved:
            self._check_precision(exact, path)
        return (exact - self.origin) * METRES[self.unit]

    def _check_precision(self, points: Float[np.ndarray, "n 3"], path: Path) -> None:
        """Refuse numbers so large that float32 steps over centimetres, if float32 held them."""
        finite = points[np.isfinite(points)]
        with np.errstate(over="ignore"):
            kept = np.array_equal(finite, finite.astype(np.float32))
        largest = float(np.abs(finite).max(initial=0.0))
        step = 2 * _FLOAT32_STEP * largest * METRES[self.unit]
        if kept and step > _COARSEST_M:
            raise BadInputError(
                f"{path}: holds coordinates of {largest:.4g} {self.unit} rounded to float32, to"
                f" {100 * step:.2g} cm; write it in float64, or subtract the sensor's position"
                " before writing it."
            )


SENSOR_METRES = Coordinates()
"""Files in their sensor's frame, in metres."""


@dataclass(frozen=True)
class ScanFile:
    """A scan as read.

    Attributes:
        points: `(n, 3)` float32, metres, sensor frame, all finite.
        dropped_nonfinite: how many points of the file were NaN, infinite or zeros alone.
    """

    points: Float32[np.ndarray, "n 3"]
    dropped_nonfinite: int


def is_scan_file(path: Path) -> bool:
    """Whether the suffix is one that `read_points` knows and the file is not hidden."""
    if path.suffix.lower() not in _READERS or path.name.startswith("."):
        return False
    return path.is_file() or (path.is_symlink() and not path.exists())  # a lost one is to be told


def checked(coordinates: Coordinates) -> Coordinates:
    """What was handed in from Python.

    Raises:
        BadInputError: a unit alone, or something else.
    """
    return expect(coordinates, Coordinates, "coordinates", "pass Coordinates('mm')")


def read_points(
    path: Path | str, coordinates: Coordinates = SENSOR_METRES
) -> Float32[np.ndarray, "n 3"]:
    """The finite points of a file, chosen by suffix, in metres; no check but `check_near`.

    Args:
        path: .ply .pcd .bin .npy .npz .xyz .txt .csv .las .laz
        coordinates: the file's unit, and the sensor's position if that is not the file's origin.

    Raises:
        BadInputError: the file is missing, damaged, of an unknown kind, or far from its origin.
    """
    points = read_all(as_path(path, "path"), checked(coordinates))
    check_near(points, str(path))
    return drop_nonfinite(points).points


def read_scan(path: Path | str, coordinates: Coordinates = SENSOR_METRES) -> ScanFile:
    """A scan that has passed `check_scan`, each place once.

    NaN and infinite points are dropped and counted, and those at the sensor (`without_origin`).

    Raises:
        BadInputError: the file cannot be read, or is no scan of an object in metres.
    """
    points = read_all(as_path(path, "path"), checked(coordinates))
    returned = without_origin(points)
    check_scan(returned, str(path))
    kept = drop_nonfinite(returned).points
    return ScanFile(without_repeats(kept), len(points) - len(kept))


def without_origin(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Those not at the sensor itself, which drivers and depth images write for no return.

    The same array comes back where none is there, or all are.
    """
    away = (points != 0).any(axis=1)
    return points if away.all() or not away.any() else points[away]


def drop_nonfinite(points: Float[np.ndarray, "n 3"]) -> ScanFile:
    """The points as float32, without those that are NaN, infinite or beyond float32."""
    kept = only_finite(points)
    return ScanFile(np.ascontiguousarray(kept, np.float32), len(points) - len(kept))


def read_all(path: Path, coordinates: Coordinates) -> Float[np.ndarray, "n 3"]:
    """All points, NaN included, in the sensor's frame, metres, in the precision of the file."""
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise BadInputError(
            f"{path}: the suffix '{suffix}' is none of a scan file; use one of "
            f"{' '.join(SUFFIXES)}."
        )
    expected, reader = _READERS[suffix]
    with reading(path, expected):
        if not path.stat().st_size:
            raise BadInputError(f"{path}: is empty (0 bytes); write or copy it again.")
        if reader is read_text:
            coordinates = coordinates.agreeing(header_unit(path), path)
        return coordinates.to_sensor(reader(path), path)


def without_repeats(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Each place once, in the order of the first: what a file repeats was not seen twice.

    Args:
        points: finite; the same array comes back where no place is repeated.
    """
    by_x = np.sort(points[:, 0])
    if not (by_x[1:] == by_x[:-1]).any():
        return points
    order = np.lexsort(points.T)  # stable: of equal places the first comes first
    placed = points[order]
    again = np.append(False, (placed[1:] == placed[:-1]).all(axis=1))
    return points[np.sort(order[~again])] if again.any() else points


def checksum_of(points: Float32[np.ndarray, "n 3"]) -> int:
    """CRC-32 of points, x y z after x y z in float32, little endian."""
    return zlib.crc32(np.ascontiguousarray(points, "<f4").data)


def check_scan(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse what cannot be a scan of one object in metres, taken by a sensor at the origin.

    Points are in metres, in the precision of the file; `name` is for the error.

    Raises:
        BadInputError: fewer than 16 finite, different points, all points equal, an extent (the
            longest side of the bounding box) over 100 m or under 1 cm, or farther than 1 km away.
    """
    if not len(points):
        raise BadInputError(
            f"{name}: is empty but for its header (0 finite points); write the scan again."
        )
    points = only_finite(points)
    if len(points) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; a scan needs at least {LEAST_POINTS}: "
            "use a denser one."
        )
    extent = _extent(points)
    if extent == 0.0:
        raise BadInputError(
            f"{name}: all {len(points)} points are equal; the file was written wrongly or "
            "is no scan."
        )
    check_one_object(points, name)
    check_repeats(points, name)
    check_near(points, name)


def check_repeats(points: Float[np.ndarray, "n 3"], name: str) -> Float[np.ndarray, "k 3"]:
    """Each place once; a few places are refused, however often they are repeated.

    Raises:
        BadInputError: fewer than 16 different points.
    """
    places = without_repeats(points)
    if len(places) < LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} points in {len(places)} places; a scan needs at least"
            f" {LEAST_POINTS}: use a denser one."
        )
    return places


def check_one_object(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse a scene, and units that are no metres; `name` is for the error.

    Raises:
        BadInputError: they are over 100 m or under 1 cm across.
    """
    extent = _extent(points)
    if extent < _SMALLEST_EXTENT:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at least "
            f"{_SMALLEST_EXTENT:g} m: "
            "normalised coordinates (write them in metres), or a unit that does not fit (if the "
            'file is in metres, drop --unit, or the "unit" of its track.json or header).'
        )
    if extent > LARGEST_EXTENT_M:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at most "
            f"{LARGEST_EXTENT_M:g} m: "
            "coordinates in millimetres (then pass --unit mm or cm) or degrees, or a whole scene "
            "(then cut the object out first, or let `wildshape drive` find its vehicles)."
        )


def _extent(points: Float[np.ndarray, "n 3"]) -> float:
    """The longest side of the bounding box, metres."""
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    return float((high - low).max())


def check_near(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse what no sensor at the origin saw, and what float32 could not hold to a millimetre.

    Raises:
        BadInputError: the points lie farther than 1 km from the origin.
    """
    points = only_finite(points)
    if not len(points):
        return
    points = points[:: 1 + len(points) // _ENOUGH]
    with np.errstate(over="ignore"):  # infinitely far is farther
        away = math.hypot(*(float(np.median(axis)) for axis in points.T))
    if away > _FARTHEST:
        raise BadInputError(
            f"{name}: lies {away:.5g} m from the origin, but a scan is in its sensor's frame,"
            f" within {_FARTHEST:g} m of it: coordinates of a map (then subtract the sensor's"
            " position there in float64; commands on objects do so with --origin X,Y,Z) or in"
            " millimetres (then write metres; commands on objects: pass --unit mm or cm)."
        )


def is_finite(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """Which points are neither NaN nor infinite nor beyond float32."""
    largest, finite = np.finfo(np.float32).max, np.ones(len(points), bool)
    for axis in points.T:  # one at a time: less memory
        finite &= np.abs(axis) <= largest
    return finite


def only_finite(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Those points; the same array where all are."""
    finite = is_finite(points)
    return points if finite.all() else points[finite]
