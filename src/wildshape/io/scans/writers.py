# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing points and triangle meshes, in the format that a file's suffix names."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal, cast, get_args

import numpy as np
from jaxtyping import Float
from torch import Tensor

from wildshape.arguments import as_path, check_fields, expect
from wildshape.errors import BadInputError
from wildshape.geometry.other_libraries import las_cloud
from wildshape.io.atomic import atomic_write

if TYPE_CHECKING:
    import trimesh

CloudFormat = Literal["ply", "pcd"]
CLOUD_FORMATS: tuple[CloudFormat, ...] = get_args(CloudFormat)
"""Of completed shapes."""
MeshFormat = Literal["ply", "obj", "glb"]
MESH_FORMATS: tuple[MeshFormat, ...] = get_args(MeshFormat)


def ply_bytes(points: Float[np.ndarray, "n 3"]) -> bytes:
    """A binary little-endian PLY file: float32 x y z.

    Raises:
        BadInputError: points are not `(n, 3)`.
    """
    if np.shape(points) != (len(points), 3):
        raise BadInputError(f"points: of shape {np.shape(points)}; pass x, y and z alone, (n, 3).")
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return header.encode() + np.asarray(points, "<f4").tobytes()


def _pcd_bytes(points: Float[np.ndarray, "n 3"]) -> bytes:
    """A binary PCD file: float32 x y z."""
    from pypcd4.pypcd4 import Encoding, PointCloud

    rows, file = np.ascontiguousarray(points, np.float32), BytesIO()
    PointCloud.from_xyz_points(rows).save(file, Encoding.BINARY)
    return file.getvalue()


def cloud_bytes(points: Float[np.ndarray, "n 3"], kind: CloudFormat) -> bytes:
    """Points as a file's content."""
    return ply_bytes(points) if kind == "ply" else _pcd_bytes(points)


def write_ply(path: Path | str, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points, metres, as binary little-endian PLY, float32 x y z, atomically."""
    with atomic_write(path) as file:
        file.write(ply_bytes(points))


_WRITERS: dict[str, Callable[[BinaryIO, Float[np.ndarray, "n 3"]], object]] = {
    ".ply": lambda file, points: file.write(ply_bytes(points)),
    ".pcd": lambda file, points: file.write(_pcd_bytes(points)),
    ".npy": np.save,
    ".xyz": partial(np.savetxt, fmt="%.6f"),
    ".txt": partial(np.savetxt, fmt="%.6f"),
    ".las": lambda file, points: las_cloud(points).write(file, do_compress=False),
    ".laz": lambda file, points: las_cloud(points).write(file, do_compress=True),
}
CLOUD_SUFFIXES = tuple(_WRITERS)
"""The suffixes of files that points are written to, in lower case."""


_FLOAT32 = (".ply", ".pcd")  # what is written holds no more
_MOST_ROUNDED_M = 1e-3


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


def write_cloud(path: Path | str, points: Float[np.ndarray, "n 3"]) -> None:
    """Write points, metres, atomically, in the format of `CLOUD_SUFFIXES` that the name ends in.

    Raises:
        BadInputError: another suffix, one of a format of float32 for points that it would move by
            over a millimetre, or LAS for a cloud wider than its whole numbers reach.
    """
    path = as_path(path, "path")
    check_suffix(path)
    expect(points, np.ndarray, "points", "save takes lists and tensors, too")
    if path.suffix.lower() in _FLOAT32:
        _check_rounding(points, path)
    try:
        with atomic_write(path) as file:
            _WRITERS[path.suffix.lower()](cast("BinaryIO", file), points)
    except OverflowError as error:
        raise BadInputError(
            f"{path}: a LAS file reaches 214 km at a tenth of a millimetre; write .npy or .xyz."
        ) from error


def _check_rounding(points: Float[np.ndarray, "n 3"], path: Path) -> None:
    if points.dtype == np.float32:
        return
    with np.errstate(over="ignore"):  # what float32 cannot hold is infinitely far off
        moved = float(np.abs(points - points.astype(np.float32)).max(initial=0.0))
    if moved > _MOST_ROUNDED_M:
        raise BadInputError(
            f"{path}: is a file of float32, which would move points by up to {100 * moved:.2g} cm;"
            " subtract the sensor's position first, or write .npy, .xyz or .las."
        )


def save(shape: object, path: str | Path) -> None:
    """Write the points of a completion, or an array `(n, 3)`, to a file.

    Args:
        shape: whatever `np.asarray` makes `(n, 3)` of; a `Completion` is its points.
        path: .ply .pcd .npy .xyz .txt .las .laz; a file of that name is replaced. .ply and .pcd
            hold float32, the others what float64 tells apart: .npy all of it, text a micrometre,
            .las and .laz a tenth of a millimetre.

    Raises:
        BadInputError: another suffix; no array `(n, 3)` of finite real numbers, none of them
            masked, or one without points; or points that the format cannot hold (`write_cloud`).
    """
    path = as_path(path, "path")
    points = _real_numbers(shape, path)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadInputError(f"{path}: cannot save an array of shape {points.shape}; pass (n, 3).")
    if not len(points):
        raise BadInputError(f"{path}: cannot save a cloud without points; check what made it.")
    if not np.isfinite(points).all():
        raise BadInputError(f"{path}: cannot save points that are NaN or infinite; drop these.")
    write_cloud(path, points)


def _real_numbers(shape: object, path: str | Path) -> Float[np.ndarray, "..."]:
    """As float32 what is no finer, all else as float64.

    Raises:
        BadInputError: it is something else.
    """
    try:
        found = np.asarray(shape.detach().cpu() if isinstance(shape, Tensor) else shape)
        if np.ma.is_masked(shape):
            raise TypeError("some is masked; save numpy.ma.compress_rows of it")
        if found.dtype.kind == "c":
            raise TypeError("complex numbers have no place in space")
        coarse = found.dtype.kind == "f" and found.dtype.itemsize <= np.float32().itemsize
        return found.astype(np.float32 if coarse else np.float64, copy=False)
    except (TypeError, ValueError, RuntimeError) as error:
        raise BadInputError(f"{path}: cannot save what is no array of numbers: {error}") from error


@dataclass(frozen=True)
class MeshFiles:
    """How meshes are wanted.

    Attributes:
        coloured: by confidence (`geometry/meshing.py`).
    """

    kind: MeshFormat = "ply"
    coloured: bool = False

    def __post_init__(self) -> None:
        check_fields(self)


def mesh_bytes(mesh: "trimesh.Trimesh", kind: MeshFormat) -> bytes:
    """A mesh as a file's content; colours go with it, PLY and GLB hold attributes, too."""
    made = mesh.export(file_type=kind)
    return made.encode() if isinstance(made, str) else bytes(made)


def write_mesh(path: Path | str, mesh: "trimesh.Trimesh") -> None:
    """Write a mesh atomically, in the format that the suffix names."""
    path = as_path(path, "path")
    with atomic_write(path) as file:
        mesh.export(file, file_type=path.suffix[1:])
