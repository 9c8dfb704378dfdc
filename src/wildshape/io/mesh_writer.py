# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing triangle meshes: PLY, OBJ, GLB."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from wildshape.io.atomic import atomic_write

if TYPE_CHECKING:
    import trimesh

MeshFormat = Literal["ply", "obj", "glb"]
MESH_FORMATS: tuple[MeshFormat, ...] = get_args(MeshFormat)


def write_mesh(path: Path, mesh: "trimesh.Trimesh") -> None:
    """Write a mesh atomically, in the format that the suffix names."""
    with atomic_write(path) as file:
        mesh.export(file, file_type=path.suffix[1:])
