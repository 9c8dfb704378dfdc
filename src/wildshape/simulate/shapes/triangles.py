# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vertices and the triangles between them, cleaned, moved and joined."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Float64, Int64, Integer, Real

Triangles = tuple[Float64[np.ndarray, "_ 3"], Int64[np.ndarray, "_ 3"]]
"""Vertices and the corners of each triangle among them."""


def used(vertices: Real[np.ndarray, "n 3"], faces: Integer[np.ndarray, "m 3"]) -> Triangles:
    """Without vertices that no triangle uses: they would enlarge the box.

    Raises:
        ValueError: a corner is none of the vertices.
    """
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError(f"triangles with corners that are none of its {len(vertices)} vertices")
    if len(vertices) > 3 * len(faces):
        wanted, corners = np.unique(faces, return_inverse=True)
        return vertices[wanted].astype(np.float64), corners.reshape(-1, 3)
    wanted = np.zeros(len(vertices), bool)
    wanted[faces] = True
    numbers = np.cumsum(wanted) - 1
    return vertices[wanted].astype(np.float64, copy=False), numbers[faces]


def joined(
    parts: Sequence[Triangles], transforms: Sequence[Float[np.ndarray, "4 4"]] | None = None
) -> Triangles:
    """All parts as one, each under its transform."""
    vertices = np.empty((sum(len(v) for v, _ in parts), 3))
    faces = np.empty((sum(len(f) for _, f in parts), 3), np.int64)
    point = row = 0
    for i, part in enumerate(parts):
        v, f = part if transforms is None else _moved(part, transforms[i])
        vertices[point : point + len(v)] = v
        np.add(f, point, out=faces[row : row + len(f)])
        point, row = point + len(v), row + len(f)
    return vertices, faces


def _moved(triangles: Triangles, T: Float[np.ndarray, "4 4"]) -> Triangles:
    """Under a transform; triangles that it turns inside out are turned back."""
    vertices, faces = triangles
    if np.array_equal(T, np.eye(4)):
        return triangles
    mirrors = np.linalg.det(T[:3, :3]) < 0
    return vertices @ T[:3, :3].T + T[:3, 3], faces[:, ::-1] if mirrors else faces
