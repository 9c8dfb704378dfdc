# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The door to scan files: points by suffix, in metres, and the checks that every scan passes."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32

from wildshape.errors import BadInputError
from wildshape.io.arrays import read_kitti_bin, read_npy, read_npz
from wildshape.io.guard import reading
from wildshape.io.las import read_las
from wildshape.io.pcd import read_pcd
from wildshape.io.ply import read_ply
from wildshape.io.ply_writer import write_ply
from wildshape.io.text import read_text

__all__ = [
    "METRES",
    "SUFFIXES",
    "ScanFile",
    "Unit",
    "check_scan",
    "drop_nonfinite",
    "is_scan_file",
    "read_points",
    "read_scan",
    "write_ply",
]

Unit = Literal["m", "cm", "mm"]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}

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

_LEAST_POINTS = 16
_LARGEST_EXTENT = 100.0
_SMALLEST_EXTENT = 0.01


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


def read_points(path: Path | str, unit: Unit = "m") -> Float32[np.ndarray, "n 3"]:
    """The finite points of a file, chosen by suffix, in metres; no other check.

    Args:
        path: .ply .pcd .bin .npy .npz .xyz .txt .csv .las .laz
        unit: of the file's coordinates.

    Raises:
        BadInputError: the file is missing, damaged, of an unknown kind, or holds no points.
    """
    return drop_nonfinite(_read(Path(path), unit)).points


def read_scan(path: Path | str, unit: Unit = "m") -> ScanFile:
    """A scan, its NaN and infinite points dropped and counted, that has passed `check_scan`.

    Raises:
        BadInputError: the file cannot be read, or is no scan of an object in metres.
    """
    scan = drop_nonfinite(_read(Path(path), unit))
    check_scan(scan.points, str(path))
    return scan


def drop_nonfinite(points: Float[np.ndarray, "n 3"]) -> ScanFile:
    """The points as float32, without those that are NaN, infinite or beyond float32."""
    with np.errstate(over="ignore", invalid="ignore"):
        points = np.ascontiguousarray(points, np.float32)
    finite = np.isfinite(points).all(1)
    dropped = len(points) - int(finite.sum())
    return ScanFile(points[finite] if dropped else points, dropped)


def check_scan(points: Float[np.ndarray, "n 3"], name: str) -> None:
    """Refuse what cannot be a scan of one object in metres.

    Args:
        points: `(n, 3)`, metres.
        name: the file, for the error.

    Raises:
        BadInputError: fewer than 16 finite points, all points equal, or an extent (the longest
            side of the bounding box) over 100 m or under 1 cm.
    """
    points = points[np.isfinite(points).all(1)]
    if len(points) < _LEAST_POINTS:
        raise BadInputError(
            f"{name}: {len(points)} finite points; a scan needs at least {_LEAST_POINTS}: "
            "use a denser one."
        )
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    extent = float((high - low).max())
    if extent == 0.0:
        raise BadInputError(
            f"{name}: all {len(points)} points are equal; the file was written wrongly or "
            "is no scan."
        )
    if extent > _LARGEST_EXTENT:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at most "
            f"{_LARGEST_EXTENT:g} m: "
            "coordinates in millimetres (then pass --unit mm or cm) or degrees, or a whole scene "
            "(then cut the object out first)."
        )
    if extent < _SMALLEST_EXTENT:
        raise BadInputError(
            f"{name}: {extent:.4g} m across, but a scan of one object is at least "
            f"{_SMALLEST_EXTENT:g} m: "
            "normalised coordinates (write them in metres), or a unit that does not fit "
            "(drop --unit mm if the file is in metres)."
        )


def _read(path: Path, unit: Unit) -> Float[np.ndarray, "n 3"]:
    """All points, NaN included, in metres."""
    if unit not in METRES:
        raise BadInputError(f"unit '{unit}' is unknown; use one of {', '.join(METRES)}.")
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise BadInputError(
            f"{path}: the suffix '{suffix}' is none of a scan file; use one of "
            f"{' '.join(SUFFIXES)}."
        )
    expected, reader = _READERS[suffix]
    with reading(path, expected):
        points = reader(path)
        return points if unit == "m" else points.astype(np.float64) * METRES[unit]
