# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""First hits of rays on triangles, by Embree."""

from dataclasses import dataclass

import numpy as np

from wildshape.errors import load_library
from wildshape.simulate.shapes.solid import Solid


@dataclass(frozen=True)
class Hits:
    """What each ray met first.

    Attributes:
        distance: `(n,)` float32 along the unit ray, metres; infinite for a miss.
        face: `(n,)` int64, -1 for a miss.
        solid: `(n,)` int64, which of the scene's solids, -1 for a miss.
        cosine: `(n,)` float32, |cos| between ray and surface normal; 0 for a miss.
    """

    distance: np.ndarray
    face: np.ndarray
    solid: np.ndarray
    cosine: np.ndarray


class Scene:
    """Some solids that rays can be cast at; built once, asked often."""

    def __init__(self, solids: list[Solid]):
        """Build the acceleration structure.

        Raises:
            MissingExtraError: embreex is not installed.
        """
        install = "pip install embreex (it has wheels for x86-64 and Apple silicon only)"
        load_library("embreex", "ray casting needs embreex", install)
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene(robust=True)
        self._meshes = [
            TriangleMesh(self._scene, s.vertices.astype(np.float32), s.faces.astype(np.int32))
            for s in solids
        ]

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """First hits of rays `origins (n, 3) + t directions (n, 3)`, unit directions."""
        o = np.ascontiguousarray(origins, np.float32)
        d = np.ascontiguousarray(directions, np.float32)
        raw = self._scene.run(o, d, query="INTERSECT", output=1)
        face = raw["primID"].astype(np.int64)
        hit = np.flatnonzero(face >= 0)
        normal = raw["Ng"].take(hit, axis=0)
        dot = np.abs(np.einsum("ij,ij->i", normal, d.take(hit, axis=0)))
        cosine = np.zeros(len(d), np.float32)
        cosine[hit] = dot / np.maximum(np.linalg.norm(normal, axis=1), 1e-20)
        distance = np.full(len(d), np.inf, np.float32)
        distance[hit] = raw["tfar"][hit]
        solid = np.full(len(d), -1, np.int64)
        solid[hit] = raw["geomID"][hit]
        return Hits(distance, face, solid, cosine)

    def blocked(self, origins: np.ndarray, directions: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Whether anything lies within `reach (n,)` metres along each ray, `(n,)` bool."""
        o = np.ascontiguousarray(origins, np.float32)
        d = np.ascontiguousarray(directions, np.float32)
        far = np.ascontiguousarray(reach, np.float32)
        return np.asarray(self._scene.run(o, d, far, query="OCCLUDED")) != -1
