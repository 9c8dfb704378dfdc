# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands beside a road: buildings, walls, hedges, trees and bushes, poles, signs, bins."""

from collections.abc import Callable, Iterator

import numpy as np

from wildshape.simulate.shapes.solid import Solid, box, cylinder, ellipsoid, union
from wildshape.simulate.street.street import LEAD_M, Street

_CLEAR_M = 0.3
Part = tuple[float, float, Solid]  # along the street, to the left of it, the solid at its origin


def roadside(
    street: Street, end: float, kept_free: np.ndarray, rng: np.random.Generator
) -> Iterator[tuple[float, Solid]]:
    """Things beside a street, each with its place along it, in the world frame.

    Nothing behind the pavement enters a circle of `kept_free`, `(n, 3)` x, y, radius, metres;
    `end`: of the last plot, metres along the street.
    """
    for side in (-1.0, 1.0):
        s = -LEAD_M
        while s < end:
            length = float(rng.uniform(8.0, 24.0))
            for along, behind, thing in _plot(length, rng):
                lateral = side * (street.half_m + street.walk_m + behind)
                placed = _stand(street, thing, s + along, lateral)
                if _is_clear(placed, kept_free):
                    yield s + along, placed
            for along, at, thing in _pavement(length, street.walk_m, rng):
                yield s + along, _stand(street, thing, s + along, side * (street.half_m + at))
            s += length


def _plot(length: float, rng: np.random.Generator) -> Iterator[Part]:
    """What stands on one plot, behind the pavement."""
    kinds = (_house, _wall, _hedge, _garden, _nothing)
    kind: Callable[[float, np.random.Generator], Iterator[Part]] = kinds[
        int(rng.choice(len(kinds), p=(0.5, 0.15, 0.12, 0.18, 0.05)))
    ]
    yield from kind(length, rng)


def _house(length: float, rng: np.random.Generator) -> Iterator[Part]:
    x, y = (length - rng.uniform(0.0, 3.0)) / 2, rng.uniform(3.0, 6.0)
    behind = y + rng.uniform(0.5, 7.0)
    yield length / 2, behind, box((-x, -y, -1.0), (x, y, rng.uniform(4.0, 14.0)))
    if behind - y > 3 and rng.random() < 0.5:
        yield from _garden(length, rng)


def _wall(length: float, rng: np.random.Generator) -> Iterator[Part]:
    x, thick, top = length / 2 - 0.3, rng.uniform(0.05, 0.15), rng.uniform(0.7, 2.4)
    yield length / 2, 0.5, box((-x, -thick, -1.0), (x, thick, top))
    yield from _garden(length, rng)


def _hedge(length: float, rng: np.random.Generator) -> Iterator[Part]:
    top, thick = rng.uniform(0.9, 2.0), rng.uniform(0.4, 0.9)
    steps = np.arange(0.5, length - 0.5, 0.6)
    bushes = [
        ellipsoid(
            (x - length / 2, rng.normal(0, 0.08), top / 2),
            (0.6, thick, top * rng.uniform(0.5, 0.6)),
        )
        for x in steps
    ]
    yield length / 2, 0.3 + thick, union(bushes)


def _garden(length: float, rng: np.random.Generator) -> Iterator[Part]:
    for _ in range(int(rng.integers(1, 5))):
        thing = tree(rng) if rng.random() < 0.4 else bush(rng)
        yield float(rng.uniform(1.0, length - 1.0)), float(rng.uniform(1.5, 8.0)), thing


def _nothing(length: float, rng: np.random.Generator) -> Iterator[Part]:
    del length, rng
    yield from ()


def _pavement(length: float, width: float, rng: np.random.Generator) -> Iterator[Part]:
    """Poles, signs and bins along the kerb, or at the plot's edge."""
    for _ in range(int(rng.integers(0, 3))):
        thing = (pole, sign, bin_, tree)[int(rng.choice(4, p=(0.4, 0.2, 0.2, 0.2)))](rng)
        at = 0.45 if rng.random() < 0.7 else width - 0.45
        yield float(rng.uniform(0.0, length)), at, thing


def pole(rng: np.random.Generator) -> Solid:
    """A lamp post."""
    radius, top = rng.uniform(0.05, 0.12), rng.uniform(3.5, 7.0)
    return cylinder(np.array((0.0, 0.0, -0.5)), np.array((0.0, 0.0, top)), (radius, radius), 8)


def sign(rng: np.random.Generator) -> Solid:
    """A traffic sign on its post."""
    top, half = rng.uniform(2.0, 2.8), rng.uniform(0.25, 0.45)
    post = cylinder(np.array((0.0, 0.0, -0.5)), np.array((0.0, 0.0, top)), (0.03, 0.03), 6)
    return union([post, box((-0.02, -half, top - 2 * half), (0.02, half, top))])


def bin_(rng: np.random.Generator) -> Solid:
    """A bin or a box of cables."""
    x, y, top = rng.uniform(0.25, 0.6), rng.uniform(0.2, 0.33), rng.uniform(0.8, 1.5)
    return box((-x, -y, -0.3), (x, y, top))


def bush(rng: np.random.Generator) -> Solid:
    """A clump of leaves."""
    wide, top = rng.uniform(0.4, 1.3), rng.uniform(0.6, 2.0)
    middles = rng.normal(0, 0.35, (5, 2)) * wide
    return union(
        [
            ellipsoid(
                (x, y, 0.45 * top),
                (wide * rng.uniform(0.4, 0.8), wide * rng.uniform(0.4, 0.8), 0.6 * top),
            )
            for x, y in middles
        ]
    )


def tree(rng: np.random.Generator) -> Solid:
    """A trunk and its crown."""
    radius, top = rng.uniform(0.08, 0.3), rng.uniform(2.0, 4.0)
    trunk = cylinder(
        np.array((0.0, 0.0, -0.5)), np.array((0.0, 0.0, top + 1)), (radius, 0.8 * radius), 8
    )
    wide = rng.uniform(1.0, 2.2)
    crown = [
        ellipsoid((x, y, top + wide * rng.uniform(0.5, 1.2)), (0.8 * wide, 0.8 * wide, 0.8 * wide))
        for x, y in rng.normal(0, 0.4, (4, 2)) * wide
    ]
    return union([trunk, *crown])


def _stand(street: Street, thing: Solid, s: float, lateral: float) -> Solid:
    """Upright at its place, along the street."""
    T = street.standing(np.array((s,)), lateral, 0.0, 0.0)[0]
    return thing.moved(T[:3, 3], yaw=float(np.arctan2(T[1, 0], T[0, 0])))


def _is_clear(thing: Solid, kept_free: np.ndarray) -> bool:
    """Whether no vertex, and no point of the lines between them, lies in a circle.

    Edges of a box are longer than a circle is wide: each triangle is tried at points 1 m apart.
    """
    a, b, c = (thing.vertices[thing.faces[:, k], :2] for k in range(3))
    steps = max(int(np.ptp(thing.vertices[:, :2], axis=0).max()), 2)
    share = np.linspace(0, 1, steps)[:, None, None]
    points = np.concatenate(
        [(p + share * (q - p)).reshape(-1, 2) for p, q in ((a, b), (b, c), (c, a))]
    )
    low, high = points.min(0), points.max(0)
    reach = kept_free[:, 2:] + _CLEAR_M
    near = kept_free[((kept_free[:, :2] > low - reach) & (kept_free[:, :2] < high + reach)).all(1)]
    if len(near) == 0:
        return True
    apart = np.linalg.norm(points[:, None] - near[:, :2], axis=-1)
    return bool((apart > near[:, 2] + _CLEAR_M).all())
