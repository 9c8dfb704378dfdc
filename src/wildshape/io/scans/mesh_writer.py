# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing triangle meshes: PLY, OBJ, GLB."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from wildshape.io.atomic import atomic_write

if TYPE_CHECKING:
    import trimesh

MeshFormat = Literal["ply", "obj", "glb"]
MESH_FORMATS: tuple[MeshFormat, ...] = get_args(MeshFormat)


@dataclass(frozen=True)
class MeshOrder:
    """How meshes are wanted.

    Attributes:
        kind: of the files.
        coloured: by confidence (`geometry/mesh_confidence.py`).
    """

    kind: MeshFormat = "ply"
    coloured: bool = False


def mesh_bytes(mesh: "trimesh.Trimesh", kind: MeshFormat) -> bytes:
    """A mesh as a file's content; colours go with it, PLY and GLB hold attributes, too."""
    made = mesh.export(file_type=kind)
    return made.encode() if isinstance(made, str) else bytes(made)


def write_mesh(path: Path, mesh: "trimesh.Trimesh") -> None:
    """Write a mesh atomically, in the format that the suffix names."""
    with atomic_write(path) as file:
        mesh.export(file, file_type=path.suffix[1:])
