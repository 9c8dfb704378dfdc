# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The door to scan files: points by suffix, in metres and the sensor's frame, and checked."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.scans.arrays import read_kitti_bin, read_npy, read_npz
from wildshape.io.scans.checks import (
    LEAST_POINTS,
    check_near,
    check_scan,
    is_finite,
    only_finite,
    without_repeats,
)
from wildshape.io.scans.las import read_las
from wildshape.io.scans.pcd import read_pcd, read_pcd_field
from wildshape.io.scans.ply import read_ply, read_ply_property
from wildshape.io.scans.point_times import TIME_FIELDS, seconds_since
from wildshape.io.scans.text import header_unit, read_text
from wildshape.io.scans.writers import write_ply
from wildshape.records import Turn, Unit

__all__ = [
    "LEAST_POINTS",
    "METRES",
    "SENSOR_METRES",
    "SUFFIXES",
    "Coordinates",
    "ScanFile",
    "Unit",
    "drop_nonfinite",
    "is_scan_file",
    "read_points",
    "read_scan",
    "read_turn",
    "write_ply",
]

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
_CLOCKS = {".ply": read_ply_property, ".pcd": read_pcd_field}
SUFFIXES = tuple(_READERS)
"""The suffixes of scan files, in lower case."""


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
        dropped_nonfinite: how many points of the file were NaN or infinite.
    """

    points: Float32[np.ndarray, "n 3"]
    dropped_nonfinite: int


def is_scan_file(path: Path) -> bool:
    """Whether the suffix is one that `read_points` knows and the file is not hidden."""
    return path.suffix.lower() in _READERS and not path.name.startswith(".") and path.is_file()


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
    points = _read(Path(path), coordinates)
    check_near(points, str(path))
    return drop_nonfinite(points).points


def read_turn(path: Path, scan_time: float | None) -> Turn:
    """A whole scan, and when its points were taken, if a binary PLY or PCD says so.

    Args:
        path: as of `read_points`.
        scan_time: of the scan, seconds, if known.

    Raises:
        BadInputError: as `read_points`.
    """
    points = _read(path, SENSOR_METRES)
    check_near(points, str(path))
    read_clock = _CLOCKS.get(path.suffix.lower())
    clock = None if read_clock is None else read_clock(path, TIME_FIELDS)
    if clock is None:
        return Turn(drop_nonfinite(points).points)
    kept = is_finite(points)
    whole = np.ascontiguousarray(points[kept], np.float32)
    clock = clock[kept]
    returned = whole.any(axis=1) | (clock != 0)  # what did not come back may have zeros alone
    seconds = seconds_since(clock[returned], scan_time)
    if seconds is None:
        return Turn(whole)
    every = np.full(len(whole), float(seconds.mean()))
    every[returned] = seconds
    return Turn(whole, every)


def read_scan(path: Path | str, coordinates: Coordinates = SENSOR_METRES) -> ScanFile:
    """A scan that has passed `check_scan`, each place once.

    NaN and infinite points are dropped and counted.

    Raises:
        BadInputError: the file cannot be read, or is no scan of an object in metres.
    """
    points = _read(Path(path), coordinates)
    check_scan(points, str(path))
    found = drop_nonfinite(points)
    return ScanFile(without_repeats(found.points), found.dropped_nonfinite)


def drop_nonfinite(points: Float[np.ndarray, "n 3"]) -> ScanFile:
    """The points as float32, without those that are NaN, infinite or beyond float32."""
    kept = only_finite(points)
    return ScanFile(np.ascontiguousarray(kept, np.float32), len(points) - len(kept))


def _read(path: Path, coordinates: Coordinates) -> Float[np.ndarray, "n 3"]:
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
