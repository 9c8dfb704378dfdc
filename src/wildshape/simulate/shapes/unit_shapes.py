# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Procedural airplanes and chairs for depth views: centred, bounding-box diagonal 1.

x forward, y left, z up.
"""

import numpy as np

from wildshape.simulate.shapes.solid import Solid, box, cylinder, ellipsoid, loft, union


def airplane(rng: np.random.Generator) -> Solid:
    """Fuselage, swept wings, tail and engines: airliner, propeller plane or jet fighter."""
    style = str(rng.choice(("airliner", "propeller", "fighter"), p=(0.6, 0.2, 0.2)))
    body = float(rng.uniform(0.045, 0.062)) * (1.25 if style == "propeller" else 1.0)
    sweep = {"airliner": (0.4, 0.7), "propeller": (0.0, 0.1), "fighter": (0.8, 1.3)}[style]
    lean = float(rng.uniform(*sweep))
    span = float(rng.uniform(0.42, 0.55)) * (0.65 if style == "fighter" else 1.0)
    root, tip = float(rng.uniform(0.15, 0.21)), float(rng.uniform(0.04, 0.07))
    high = 0.7 * body if style == "propeller" and rng.random() < 0.6 else -0.5 * body
    wing_x = float(rng.uniform(0.05, 0.12))
    dihedral = float(rng.uniform(0.02, 0.12))
    parts = [_fuselage(body, style, rng)]
    parts += [_wing(wing_x, s * span, (root, tip), lean, dihedral, high) for s in (-1, 1)]
    tail = span * float(rng.uniform(0.33, 0.42))
    tail_z = float(rng.choice((0.3, 0.3, 2.6))) * body
    parts += [_wing(-0.38, s * tail, (0.10, 0.05), lean, 0.05, tail_z) for s in (-1, 1)]
    parts.append(_fin(body, float(rng.uniform(0.11, 0.17)), max(lean, 0.3)))
    parts += _engines(style, body, span, lean, wing_x, high, rng)
    return union(parts, f"airplane {style}").centred(1.0)


def _fuselage(radius: float, style: str, rng: np.random.Generator) -> Solid:
    x = np.array((0.5, 0.49, 0.46, 0.41, 0.33, 0.1, -0.15, -0.3, -0.42, -0.5))
    sharp = (0.05, 0.16, 0.34, 0.55, 0.8, 1.0, 1.0, 0.85, 0.6, 0.4)
    blunt = (0.12, 0.45, 0.75, 0.93, 1.0, 1.0, 1.0, 0.8, 0.45, 0.12)
    r = radius * np.array(sharp if style == "fighter" else blunt)
    lift = radius * np.array((-0.3, -0.25, -0.15, -0.05, 0, 0, 0, 0.15, 0.4, 0.65))
    angle = 2 * np.pi * np.arange(18) / 18
    squash = float(rng.uniform(0.9, 1.15))
    ring = np.stack((0 * angle, np.cos(angle), squash * np.sin(angle)), -1)
    middle = np.stack((x, 0 * x, lift), -1)
    return loft(middle[:, None] + r[:, None, None] * ring)


_AIRFOIL = np.array((
    (0.0, 0.0), (0.03, 0.035), (0.15, 0.07), (0.4, 0.075), (0.75, 0.035), (1.0, 0.002),
    (1.0, -0.002), (0.75, -0.02), (0.4, -0.045), (0.15, -0.045), (0.03, -0.025),
))  # fmt: skip


def _wing(
    x: float, span: float, chords: tuple[float, float], sweep: float, dihedral: float, z: float
) -> Solid:
    """One wing from the body's middle to `y = span`; leading edge at x, x-forward."""
    share = np.linspace(0.0, 1.0, 6)
    chord = chords[0] + share * (chords[1] - chords[0])
    front = x - sweep * share * abs(span)
    sections = np.empty((6, len(_AIRFOIL), 3))
    sections[..., 0] = front[:, None] - chord[:, None] * _AIRFOIL[:, 0]
    sections[..., 1] = (share * span)[:, None]
    up = z + dihedral * share * abs(span)
    sections[..., 2] = up[:, None] + 0.9 * chord[:, None] * _AIRFOIL[:, 1]
    return loft(sections)


def _fin(body: float, height: float, sweep: float) -> Solid:
    share = np.linspace(0.0, 1.0, 4)
    chord = 0.14 - 0.08 * share
    sections = np.empty((4, len(_AIRFOIL), 3))
    front = -0.35 - sweep * share * height
    sections[..., 0] = front[:, None] - chord[:, None] * _AIRFOIL[:, 0]
    sections[..., 1] = chord[:, None] * _AIRFOIL[:, 1]
    sections[..., 2] = (0.2 * body + share * (height + 0.8 * body))[:, None]
    return loft(sections)


def _engines(
    style: str, body: float, span: float, sweep: float, x: float, z: float,
    rng: np.random.Generator,
) -> list[Solid]:  # fmt: skip
    r = body * float(rng.uniform(0.4, 0.58))
    if style == "propeller":
        blade = body * 1.9
        return [
            ellipsoid((0.5, 0.0, -0.3 * body), (0.02, 0.25 * body, 0.25 * body)),
            box((0.502, -0.008, -blade - 0.3 * body), (0.508, 0.008, blade - 0.3 * body)),
        ]
    if style == "fighter":
        return [_engine((-0.32, s * 0.6 * body, 0.0), 0.18, 0.6 * body) for s in (-1, 1)]
    if rng.random() < 0.2:
        return [_engine((-0.30, s * (body + r), 0.4 * body), 0.12, r) for s in (-1, 1)]
    stations = (0.33,) if rng.random() < 0.7 else (0.3, 0.6)
    return [
        _engine((x + 0.02 - sweep * share * span, s * share * span, z - 1.0 * r), 0.11, r)
        for share in stations
        for s in (-1, 1)
    ]


def _engine(middle: tuple[float, float, float], length: float, radius: float) -> Solid:
    at, half = np.asarray(middle), np.array((length / 2, 0.0, 0.0))
    radii = tuple(radius * f for f in (0.85, 1.0, 1.0, 0.9, 0.6))
    return cylinder(at + half, at - half, radii, 12)


def chair(rng: np.random.Generator) -> Solid:
    """Seat, back, legs or a pedestal, sometimes arms; the sitter looks along x."""
    wide, deep = float(rng.uniform(0.40, 0.58)), float(rng.uniform(0.40, 0.55))
    seat, thick = float(rng.uniform(0.38, 0.48)), float(rng.uniform(0.03, 0.12))
    tall, tilt = float(rng.uniform(0.35, 0.65)), float(rng.uniform(0.0, 0.25))
    x, y = deep / 2, wide / 2
    parts = [box((-x, -y, seat - thick), (x, y, seat))]
    parts += _back(x, y, (seat - thick, seat + tall), tilt, rng)
    parts += _legs(x, y, seat - thick, rng)
    if rng.random() < 0.45:
        parts += _arms(x, y, seat, rng)
    return union(parts, "chair").centred(1.0)


def _bar(start: tuple[float, ...], end: tuple[float, ...], radius: float, sides: int) -> Solid:
    return cylinder(np.asarray(start, float), np.asarray(end, float), (radius, radius), sides)


def _back(
    x: float, y: float, heights: tuple[float, float], tilt: float, rng: np.random.Generator
) -> list[Solid]:
    low, high = heights
    lean = tilt * (high - low)
    thick = float(rng.uniform(0.025, 0.08))
    if rng.random() < 0.6:
        return [_slab(x, y * float(rng.uniform(0.8, 1.0)), heights, lean, thick)]
    bars = int(rng.integers(3, 7))
    across = np.linspace(-y + 0.02, y - 0.02, bars)
    parts = [_bar((-x + 0.02, a, low), (-x + 0.02 - lean, a, high), 0.013, 8) for a in across]
    parts.append(_bar((-x + 0.02 - lean, -y, high), (-x + 0.02 - lean, y, high), 0.025, 8))
    return parts


def _slab(x: float, y: float, heights: tuple[float, float], lean: float, thick: float) -> Solid:
    """A back rest: bent backward over its height."""
    share = np.linspace(0, 1, 5)
    sections = np.empty((5, 4, 3))
    behind = -x - lean * share**1.5
    sections[..., 0] = behind[:, None] + np.array((0.0, thick, thick, 0.0))
    sections[..., 1] = np.array((-y, -y, y, y))
    sections[..., 2] = (heights[0] + share * (heights[1] - heights[0]))[:, None]
    return loft(sections)


def _legs(x: float, y: float, top: float, rng: np.random.Generator) -> list[Solid]:
    style = rng.random()
    if style < 0.7:
        splay = float(rng.uniform(0.0, 0.06))
        radius, sides = float(rng.uniform(0.015, 0.03)), int(rng.choice((4, 10)))
        return [
            _bar(
                (sx * (x - 0.03), sy * (y - 0.03), top),
                (sx * (x - 0.03 + splay), sy * (y - 0.03 + splay), 0.0), radius, sides,
            )
            for sx in (-1, 1)
            for sy in (-1, 1)
        ]  # fmt: skip
    if style < 0.9:
        star = 2 * np.pi * np.arange(5) / 5 + rng.uniform(0, 1)
        arms = [(0.3 * np.cos(a), 0.3 * np.sin(a), 0.03) for a in star]
        return [
            _bar((0.0, 0.0, 0.05), (0.0, 0.0, top), 0.03, 12),
            *[_bar((0.0, 0.0, 0.07), arm, 0.02, 6) for arm in arms],
        ]
    return [box((-x, s * y - 0.02, 0.0), (x, s * y + 0.02, top)) for s in (-1, 1)]


def _arms(x: float, y: float, seat: float, rng: np.random.Generator) -> list[Solid]:
    z, front = seat + float(rng.uniform(0.15, 0.25)), x * float(rng.uniform(0.4, 0.9))
    parts = []
    for s in (-1, 1):
        parts.append(box((-x, s * y - 0.025, z - 0.02), (front, s * y + 0.025, z + 0.02)))
        parts.append(_bar((front - 0.03, s * y, seat - 0.02), (front - 0.03, s * y, z), 0.018, 8))
    return parts
