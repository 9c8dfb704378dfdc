# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Closed triangle surfaces, and the few ways of making them: loft, box, cylinder, ellipsoid."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Solid:
    """A union of closed parts, or a user's mesh; x forward, y left, z up.

    Attributes:
        vertices: `(v, 3)` float64, metres (or unit diagonal).
        faces: `(f, 3)` int64, outward by the right-hand rule for our own parts.
        glass: `(f,)` bool, faces that return few pulses.
        parts: `(f,)` int64, which closed part a face belongs to.
        kind: what it is, for example `sedan`.
        closed: whether every part is watertight with its faces outward.
    """

    vertices: np.ndarray
    faces: np.ndarray
    glass: np.ndarray
    parts: np.ndarray
    kind: str = ""
    closed: bool = True

    @cached_property
    def bounds(self) -> np.ndarray:
        """`(2, 3)` smallest and largest corner."""
        return np.stack((self.vertices.min(0), self.vertices.max(0)))

    def moved(self, offset: np.ndarray, scale: float = 1.0, yaw: float = 0.0) -> "Solid":
        """Turned about z by `yaw` radians, scaled, then shifted by `offset`."""
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
        vertices = (self.vertices @ turn.T) * scale + offset
        return replace(self, vertices=vertices)

    def centred(self, diagonal: float | None = None) -> "Solid":
        """Bounding-box centre at the origin; optionally scaled to a box diagonal."""
        low, high = self.bounds
        scale = 1.0 if diagonal is None else diagonal / float(np.linalg.norm(high - low))
        return self.moved(-scale * (low + high) / 2, scale)


def solid(vertices: np.ndarray, faces: np.ndarray, glass: np.ndarray | None = None) -> Solid:
    """One part, turned outside out if its volume is negative."""
    corners = vertices.take(faces, axis=0)
    volume = np.einsum("ij,ij->", corners[:, 0], _cross(corners[:, 1], corners[:, 2])) / 6
    faces = faces[:, ::-1] if volume < 0 else faces
    no_glass = np.zeros(len(faces), bool) if glass is None else glass
    return Solid(vertices, faces.astype(np.int64), no_glass, np.zeros(len(faces), np.int64))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """`numpy.cross`, which takes three times as long for a few vectors."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


def union(parts: list[Solid], kind: str = "") -> Solid:
    """All parts as one; they may overlap (rays stop at the first hit)."""
    starts = np.cumsum([0] + [len(p.vertices) for p in parts])
    first_part = np.cumsum([0] + [int(p.parts.max()) + 1 for p in parts])
    return Solid(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.faces + s for p, s in zip(parts, starts)]),
        np.concatenate([p.glass for p in parts]),
        np.concatenate([p.parts + i for p, i in zip(parts, first_part)]),
        kind,
    )


def loft(sections: np.ndarray, glass: np.ndarray | None = None) -> Solid:
    """A closed skin over closed cross-sections.

    Args:
        sections: `(s, k, 3)`, k points around each of s sections, in the same order.
        glass: `(s - 1, k)` bool, patches between section i, i + 1 and point j, j + 1.

    Returns:
        The solid; the two ends are closed by fans to their middles.
    """
    s, k, _ = sections.shape
    i, j = np.meshgrid(np.arange(s - 1), np.arange(k), indexing="ij")
    a, b = i * k + j, i * k + (j + 1) % k
    sides = np.stack((a, b, b + k, a, b + k, a + k), -1).reshape(-1, 3)
    around = np.arange(k)
    after = (around + 1) % k
    first = np.stack((np.full(k, s * k), after, around), -1)
    last = np.stack((np.full(k, s * k + 1), (s - 1) * k + around, (s - 1) * k + after), -1)
    ends = sections[[0, -1]].mean(1)
    vertices = np.concatenate((sections.reshape(-1, 3), ends))
    pane = np.zeros((s - 1, k), bool) if glass is None else glass
    dark = np.concatenate((np.repeat(pane.reshape(-1), 2), np.zeros(2 * k, bool)))
    return solid(vertices, np.concatenate((sides, first, last)), dark)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    """Axis-aligned box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    ring = np.array(((y0, z0), (y1, z0), (y1, z1), (y0, z1)))
    sections = np.stack([np.column_stack((np.full(4, x), ring)) for x in (x0, x1)])
    return loft(sections)


def cylinder(start: np.ndarray, end: np.ndarray, radii: tuple[float, ...], sides: int) -> Solid:
    """A round bar from `start` to `end`; `radii` at equal steps between (at least two)."""
    axis = end - start
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    u = _cross(axis, helper)
    u /= np.linalg.norm(u)
    w = _cross(axis, u) / np.linalg.norm(axis)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * w
    middle = start + np.linspace(0, 1, len(radii))[:, None] * axis
    return loft(middle[:, None] + np.asarray(radii)[:, None, None] * ring)


def ellipsoid(middle: tuple[float, float, float], half: tuple[float, float, float]) -> Solid:
    """A coarse ellipsoid (8 x 5)."""
    bar = cylinder(
        np.array((-1.0, 0.0, 0.0)), np.array((1.0, 0.0, 0.0)), (0.35, 0.86, 1.0, 0.86, 0.35), 8
    )
    return replace(bar, vertices=bar.vertices * np.asarray(half) + np.asarray(middle))
