# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes side by side, a row for each output of `wildshape complete --mesh`.

    wildshape complete kitti --out one --mesh
    wildshape complete kitti --out track --track --mesh
    python experiments/meshes_picture.py docs/meshes.webp one track

Ten tracks are drawn, evenly chosen by name, or all if there are fewer; of each the middle scan.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import trimesh
import tyro
from PIL import Image

from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError
from wildshape.io.boxes.detections import pose_of
from wildshape.io.guard import read_json
from wildshape.report.results import OBJECTS, box_of, find
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import Solid

_WIDTH_PX, _COLUMNS = 200, 5  # of a panel, and panels in a line
_COLOUR, _SHOWN, _AZIMUTH_DEG, _ELEVATION_DEG = (110, 150, 190), 10, 145.0, 22.0


@dataclass(frozen=True)
class Settings:
    """What to draw.

    Attributes:
        out: .webp or .png.
        rows: folders with outputs of `complete --mesh`, of the same tracks each.
    """

    out: Annotated[Path, tyro.conf.Positional]
    rows: Annotated[tuple[Path, ...], tyro.conf.Positional]


def main(settings: Settings) -> None:
    """Draw some tracks, each row's panel below that of the row before."""
    found = [[path.parent for path in find(row, OBJECTS)] for row in settings.rows]
    if not found or not found[0] or len({len(folders) for folders in found}) > 1:
        raise BadInputError("the folders hold no objects.json, or not the same tracks.")
    shown = min(_SHOWN, len(found[0]))
    chosen = np.linspace(0, len(found[0]) - 1, shown).round().astype(int)
    columns = [np.concatenate([panel(row[i], _WIDTH_PX) for row in found]) for i in chosen]
    columns += [np.full_like(columns[0], 255)] * (-shown % _COLUMNS)  # the last line's end
    lines = [columns[i : i + _COLUMNS] for i in range(0, len(columns), _COLUMNS)]
    picture = np.concatenate([np.concatenate(line, axis=1) for line in lines])
    Image.fromarray(picture).save(settings.out, quality=85)


def panel(folder: Path, width: int) -> np.ndarray:
    """The middle scan's mesh in its box's frame, from behind and the left."""
    entries = read_json(folder / OBJECTS, "what complete writes")["scans"]
    entry = entries[len(entries) // 2]
    box = box_of(entry)
    assert box is not None
    mesh = trimesh.load_mesh(next((folder / "mesh").glob(f"{entry['scan']}.*")))
    mesh.apply_transform(pose_of(box).inverse().matrix.numpy())
    return shaded(mesh, width)


def shaded(mesh: trimesh.Trimesh, width: int) -> np.ndarray:
    """`(h, width, 3)`: a mesh as large as the panel."""
    height = round(0.62 * width)
    azimuth, elevation = np.radians((_AZIMUTH_DEG, _ELEVATION_DEG))
    level = np.cos(elevation)
    towards = np.array((level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)))
    right = np.cross((0.0, 0.0, 1.0), towards) / level
    up = np.cross(towards, right)
    size = 1.05 * mesh.extents.max()
    x, y = np.meshgrid(np.arange(width) + 0.5, height - np.arange(height) - 0.5)
    x, y = (part.ravel()[:, None] - middle / 2 for part, middle in ((x, width), (y, height)))
    origins = mesh.bounds.mean(0) + 2 * size * towards + size / width * (x * right + y * up)
    none = np.zeros(len(mesh.faces), np.int64)
    solid = Solid(mesh.vertices.view(np.ndarray), mesh.faces.view(np.ndarray), none > 0, none)
    faces = Scene([solid]).cast(origins, np.broadcast_to(-towards, origins.shape)).face
    light = towards + 0.7 * up - 0.5 * right
    normals = mesh.vertex_normals[mesh.faces].mean(1)[faces]
    bright = 0.25 + 0.8 * np.clip(normals @ light / np.linalg.norm(light), 0, 1)
    image = np.where(faces[:, None] < 0, 255.0, bright[:, None] * _COLOUR)
    return np.clip(image, 0, 255).astype(np.uint8).reshape(height, width, 3)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
