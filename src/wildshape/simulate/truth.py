# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The complete shape: points spread evenly over the surface that can be seen from outside."""

import numpy as np

from wildshape.errors import BadInputError
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import Solid

_LOOKS = 12  # directions from which each point is looked at


def visible_surface(
    solid: Solid, scene: Scene, count: int, lowest_deg: float, rng: np.random.Generator
) -> np.ndarray:
    """`(count, 3)` float32 points on the outer visible surface, uniform by area.

    Points are drawn uniformly by area over all triangles; one counts as visible if it is the
    first hit from far away in at least one of some random directions. What is inside a closed
    body, or under a car, is therefore not in it.

    `lowest_deg`: lowest elevation from which it is looked at: 0 for objects that stand on the road
    (a LiDAR, higher than a car's floor, never looks up at it), -90 for objects seen from
    everywhere. `scene` is of the object alone.

    Raises:
        BadInputError: nearly nothing of the surface can be seen from outside.
    """
    found, have = [], 0
    for _ in range(12):
        points, normals = on_surface(solid, int(1.5 * (count - have)) + 64, rng)
        seen = points[_seen(points, normals, solid, scene, lowest_deg, rng)]
        found.append(seen)
        have += len(seen)
        if have >= count:
            return np.concatenate(found)[:count].astype(np.float32)
    raise BadInputError(
        f"the mesh {solid.kind or 'given'} shows {have} of {count} surface points to the outside, "
        "expected nearly all: check that it holds one object and no empty triangles."
    )


def on_surface(solid: Solid, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`(count, 3)` points, uniform by area (stratified along the triangle list), and normals."""
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    cumulative = np.cumsum(np.linalg.norm(normal, axis=1))
    at = (np.arange(count) + rng.random(count)) / count * cumulative[-1]  # rising: found fast
    face = np.minimum(np.searchsorted(cumulative, at), len(normal) - 1)
    face = face[rng.permutation(count)]
    u, v = rng.random((2, count, 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    corner, along, across, outward = (x.take(face, axis=0) for x in (a, b - a, c - a, normal))
    return corner + u * along + v * across, outward


def _seen(
    points: np.ndarray,
    normals: np.ndarray,
    solid: Solid,
    scene: Scene,
    lowest_deg: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """`(n,)` bool: the first thing met from far away in one of the directions."""
    low, high = solid.bounds
    far = 2 * float(np.linalg.norm(high - low))
    # The side from which a point is looked at first, where most are seen at once: that of its
    # face, if faces are known to look outward, else that of the point.
    side = normals if solid.closed else points - (low + high) / 2
    seen = np.zeros(len(points), bool)
    pool = _directions(2048, lowest_deg, rng)
    for turn in range(_LOOKS):
        left = np.flatnonzero(~seen)
        toward = pool.take(rng.integers(0, len(pool), len(left)), axis=0)
        outward = side.take(left, axis=0)
        if solid.closed or turn % 2 == 0:
            away = np.einsum("ij,ij->i", outward[:, :2], toward[:, :2]) < 0
            toward[:, :2] *= np.where(away, -1.0, 1.0)[:, None]
        if solid.closed:  # from behind, a closed body hides its own face
            faces_us = np.flatnonzero(np.einsum("ij,ij->i", outward, toward) > 0)
            left, toward = left[faces_us], toward.take(faces_us, axis=0)
        reach = np.full(len(left), far * (1 - 2e-4))
        hidden = scene.blocked(points.take(left, axis=0) + far * toward, -toward, reach)
        seen[left[~hidden]] = True
    return seen


def _directions(count: int, lowest_deg: float, rng: np.random.Generator) -> np.ndarray:
    """`(count, 3)` unit vectors, uniform over the sphere above an elevation."""
    z = rng.uniform(np.sin(np.radians(lowest_deg)), 1.0, count)
    azimuth = rng.uniform(0, 2 * np.pi, count)
    flat = np.sqrt(1 - z * z)
    return np.stack((flat * np.cos(azimuth), flat * np.sin(azimuth), z), -1)
