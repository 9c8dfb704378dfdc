# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing points, in the format that the file's suffix names."""

from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.geometry.other_libraries import las_cloud
from wildshape.io.atomic import atomic_write
from wildshape.io.scans.ply_writer import ply_bytes

CLOUD_SUFFIXES = (".ply", ".pcd", ".npy", ".xyz", ".txt", ".las", ".laz")


def check_suffix(path: Path) -> None:
    """Refuse a name that tells no format.

    Raises:
        BadInputError: its suffix is none of `CLOUD_SUFFIXES`.
    """
    if path.suffix.lower() not in CLOUD_SUFFIXES:
        raise BadInputError(
            f"{path}: a cloud is written as one of {' '.join(CLOUD_SUFFIXES)}; give it such a"
            " suffix."
        )


def write_cloud(path: Path, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points atomically.

    Args:
        path: .ply .pcd .npy .xyz .txt .las .laz
        points: metres.

    Raises:
        BadInputError: another suffix.
    """
    check_suffix(path)
    suffix = path.suffix.lower()
    with atomic_write(path) as file:
        if suffix == ".ply":
            file.write(ply_bytes(points))
        elif suffix == ".pcd":
            _write_pcd(cast(BinaryIO, file), points)
        elif suffix == ".npy":
            np.save(file, points)
        elif suffix in (".las", ".laz"):
            las_cloud(points).write(cast(BinaryIO, file), do_compress=suffix == ".laz")
        else:
            np.savetxt(file, points, fmt="%.6f")


def _write_pcd(file: BinaryIO, points: Float[np.ndarray, "n 3"]) -> None:
    """Binary, float32 x y z."""
    from pypcd4.pypcd4 import Encoding, PointCloud

    rows = np.ascontiguousarray(points, np.float32)
    PointCloud.from_xyz_points(rows).save(file, Encoding.BINARY)


def save(shape: object, path: str | Path) -> None:
    """Write the points of a completion, or an array `(n, 3)`, to a file.

    Args:
        shape: whatever `np.asarray` makes `(n, 3)` of; a `Completion` is its points.
        path: .ply .pcd .npy .xyz .txt .las .laz; a file of that name is replaced.

    Raises:
        BadInputError: another suffix, or no array `(n, 3)`.
    """
    try:
        points = np.asarray(shape, np.float32)
    except (TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"{path}: cannot save what is no array of numbers: {error}") from error
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInputError(f"{path}: cannot save an array of shape {points.shape}; pass (n, 3).")
    write_cloud(Path(path), points)
