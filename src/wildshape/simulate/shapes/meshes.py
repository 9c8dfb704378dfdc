# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The user's own meshes as objects: PLY, OBJ, STL, OFF; x forward, y left, z up.

glTF says itself what its axes are (2.0, section 3.4): y up, z forward.
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.scans.ply_mesh import read_ply_mesh
from wildshape.simulate.shapes.gltf import read_gltf
from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.shapes.text_meshes import read_obj, read_off, read_stl
from wildshape.simulate.shapes.triangles import used

_READERS: dict[str, Callable[[Path], tuple[np.ndarray, np.ndarray]]] = {
    ".ply": read_ply_mesh,
    ".obj": read_obj,
    ".stl": read_stl,
    ".off": read_off,
    ".glb": read_gltf,
    ".gltf": read_gltf,
}
_Y_UP = (".glb", ".gltf")
_SMALLEST_M, _LARGEST_M = 0.5, 30.0


def mesh_files(folder: Path) -> tuple[Path, ...]:
    """All meshes below a folder, sorted by path.

    Raises:
        BadInputError: no such folder, or no mesh in it.
    """
    if not folder.is_dir():
        raise BadInputError(f"{folder} is no folder, expected one with meshes.")
    files = (path for path in folder.rglob("*") if not path.name.startswith("."))
    found = sorted(path for path in files if path.suffix.lower() in _READERS)
    if not found:
        raise BadInputError(f"{folder} holds no mesh, expected files {' '.join(_READERS)}.")
    return tuple(found)


def read_mesh(path: Path, metres: bool) -> Solid:
    """One mesh, box centre at the origin.

    Args:
        path: the file; a scene of several meshes is taken as one.
        metres: keep the size, which must be that of something a LiDAR passes (0.5 to 30 m);
            otherwise scale to a box diagonal of 1.

    Raises:
        BadInputError: unreadable, no triangles, not finite, or of a size that is not in metres.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a damaged file's numbers
            vertices, faces = used(*_READERS[path.suffix.lower()](path))
        if path.suffix.lower() in _Y_UP:
            vertices = vertices[:, (2, 0, 1)]
    except BadInputError:
        raise
    except Exception as cause:  # a damaged file raises nearly anything
        raise BadInputError(
            f"{path} cannot be read as a mesh ({cause}); export it anew."
        ) from cause
    if len(faces) == 0:
        raise BadInputError(f"{path} holds no triangles, expected a surface, not points or lines.")
    extent = float(np.ptp(vertices, axis=0).max())
    if not np.isfinite(vertices).all() or extent <= 0:
        raise BadInputError(f"{path} has vertices that are not finite or all equal; repair it.")
    if metres and not _SMALLEST_M <= extent <= _LARGEST_M:
        raise BadInputError(
            f"{path} is {extent:.4g} long, expected {_SMALLEST_M:g} to {_LARGEST_M:g} metres for a "
            f"LiDAR: {_advice(extent)}."
        )
    no_glass, one_part = np.zeros(len(faces), bool), np.zeros(len(faces), np.int64)
    solid = Solid(vertices, faces, no_glass, one_part, path.stem, closed=False)
    return solid.centred(None if metres else 1.0)


def doubt_of_axes(folder: Path) -> str:
    """What is odd about the first of a folder's meshes, taken for a vehicle's; or nothing.

    Raises:
        BadInputError: as `mesh_files` and `read_mesh`.
    """
    first = mesh_files(folder)[0]
    length, width, height = np.ptp(read_mesh(first, metres=True).bounds, axis=0)
    if length >= max(width, height):
        return ""
    return (
        f"{first} is {length:.1f} m along x, {width:.1f} along y, {height:.1f} along z, which are"
        " taken for forward, left and up; turn it if it is a vehicle"
    )


def _advice(extent: float) -> str:
    if extent > _LARGEST_M:
        return "it looks like millimetres or inches, scale it to metres"
    return "it looks like unit scale, scale it to metres or use --sensor depth-camera"
