# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Procedural road vehicles: a lofted body with wheel wells, wheels and mirrors.

Metres, x forward, y left, wheels on z = 0. The front differs from the back: bonnet and boot of
different length, windscreen and rear window of different slope.
"""

from dataclasses import dataclass, replace

import numpy as np

from wildshape.simulate.shapes.solid import Solid, box, cylinder, ellipsoid, loft, union
from wildshape.simulate.shapes.variety import varied

_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    # Shares of the length from the front for bonnet front, cowl, roof front, roof rear, deck.
    "sedan": {
        "length": (4.2, 5.1), "width": (1.7, 1.95), "height": (1.36, 1.52),
        "cowl": (0.25, 0.31), "roof0": (0.41, 0.47), "roof1": (0.66, 0.72), "deck": (0.82, 0.88),
        "hood": (0.60, 0.67), "belt": (0.63, 0.69), "trunk": (0.66, 0.74), "tumble": (0.3, 0.45),
    },
    "hatchback": {
        "length": (3.4, 4.4), "width": (1.6, 1.85), "height": (1.42, 1.72),
        "cowl": (0.20, 0.28), "roof0": (0.38, 0.44), "roof1": (0.82, 0.90), "deck": (0.94, 0.975),
        "hood": (0.57, 0.65), "belt": (0.60, 0.67), "trunk": (0.60, 0.68), "tumble": (0.2, 0.4),
    },
    "van": {
        "length": (4.4, 5.6), "width": (1.8, 2.1), "height": (1.75, 2.5),
        "cowl": (0.11, 0.19), "roof0": (0.26, 0.33), "roof1": (0.93, 0.965), "deck": (0.98, 0.99),
        "hood": (0.46, 0.56), "belt": (0.52, 0.58), "trunk": (0.46, 0.56), "tumble": (0.08, 0.2),
    },
    "pickup": {
        "length": (4.8, 5.6), "width": (1.75, 2.0), "height": (1.68, 1.95),
        "cowl": (0.23, 0.28), "roof0": (0.34, 0.38), "roof1": (0.53, 0.64), "deck": (0.57, 0.66),
        "hood": (0.58, 0.64), "belt": (0.60, 0.65), "trunk": (0.56, 0.63), "tumble": (0.2, 0.35),
    },
    "truck": {
        "length": (5.8, 9.0), "width": (2.0, 2.5), "height": (2.5, 3.5),
        "cowl": (0.02, 0.05), "roof0": (0.07, 0.10), "roof1": (0.24, 0.27), "deck": (0.25, 0.28),
        "hood": (0.42, 0.5), "belt": (0.46, 0.52), "trunk": (0.42, 0.5), "tumble": (0.05, 0.1),
    },
    "transporter": {
        "length": (5.3, 7.0), "width": (1.9, 2.1), "height": (2.3, 2.9),
        "cowl": (0.09, 0.15), "roof0": (0.20, 0.26), "roof1": (0.96, 0.975), "deck": (0.985, 0.99),
        "hood": (0.40, 0.48), "belt": (0.46, 0.52), "trunk": (0.42, 0.5), "tumble": (0.04, 0.12),
    },
}  # fmt: skip
KINDS = tuple(_RANGES)
_SHARES = (0.34, 0.34, 0.14, 0.10, 0.08, 0.0)
ROUNDEST_M = 0.12
_VARIED_SHARES = (0.26, 0.34, 0.15, 0.09, 0.08, 0.08)


@dataclass(frozen=True)
class _Body:
    """One instance's numbers, metres; `x` is measured backward from the front bumper."""

    kind: str
    length: float
    width: float
    height: float
    top: np.ndarray
    belt: float
    floor: float
    tumble: float
    wheel_x: tuple[float, ...]
    wheel_radius: float
    bed: tuple[float, float]
    corner: float
    panel: bool

    @property
    def glass_x(self) -> np.ndarray:
        """Cowl, roof front, roof rear, deck: where the panes begin and end."""
        return self.top[2:6, 0]


def vehicle(kind: str, rng: np.random.Generator, roundest_m: float | None = None) -> Solid:
    """A random vehicle of a kind in `KINDS`; box middle above the origin, wheels on z = 0.

    `roundest_m`: how far its corners, seen from above, stand back at most; None: as usual.
    """
    body = _draw(kind, rng)
    if roundest_m is not None:
        body = replace(body, corner=float(rng.uniform(0.0, roundest_m)))
    parts = [_shell(body), *_wheels(body), *_mirrors(body)]
    if kind == "truck":
        parts += _cargo(body, rng)
    whole = union(parts, kind)
    low, high = whole.bounds
    middle = (low + high) / 2
    return whole.moved(np.array((-middle[0], -middle[1], -low[2])))


def random_vehicle(rng: np.random.Generator) -> Solid:
    """A car of a random kind: mostly sedans and hatchbacks."""
    return vehicle(str(rng.choice(KINDS, p=_SHARES)), rng)


def varied_vehicle(rng: np.random.Generator) -> Solid:
    """A car of a random kind, more vans and transporters among them, its size and form varied."""
    return varied(vehicle(str(rng.choice(KINDS, p=_VARIED_SHARES)), rng, ROUNDEST_M), rng)


def _draw(kind: str, rng: np.random.Generator) -> _Body:
    r = {name: float(rng.uniform(*span)) for name, span in _RANGES[kind].items()}
    length, height = r["length"], r["height"]
    hood, belt, trunk = (r[name] * height for name in ("hood", "belt", "trunk"))
    nose = hood * rng.uniform(0.78, 0.92)
    slope = float(rng.uniform(0.68, 0.86))  # of the bonnet's front edge
    tail = trunk * rng.uniform(0.86, 0.97)
    cowl, roof0, roof1, deck = (r[name] * length for name in ("cowl", "roof0", "roof1", "deck"))
    bow = float(rng.uniform(0.96, 0.995))  # the roof falls backward
    arc = height * rng.uniform(0.965, 0.985)
    top = np.array((
        (0.0, nose * slope), (min(0.16, 0.6 * cowl), nose), (cowl, hood),
        (roof0, arc), (roof1, arc * bow), (deck, trunk),
        (length - 0.06, tail), (length, tail * 0.86),
    ))  # fmt: skip
    if kind == "truck":
        top[6:, 0] = deck + 0.05, deck + 0.1
    radius = float(rng.uniform(0.29, 0.35) if kind != "truck" else rng.uniform(0.38, 0.48))
    front = float(rng.uniform(0.16, 0.20)) * length
    rear = length - float(rng.uniform(0.16, 0.24)) * length
    if kind == "truck":
        front = float(rng.uniform(0.12, 0.16)) * length
    corner = float(rng.uniform(0.15, 0.38) if kind != "truck" else rng.uniform(0.05, 0.15))
    panel = kind in ("truck", "transporter") or (kind == "van" and rng.random() < 0.4)
    return _Body(
        kind, length, r["width"], height, top, belt, float(rng.uniform(0.18, 0.26)),
        r["tumble"], (front, rear), radius,
        (deck + 0.05, length - 0.08) if kind == "pickup" else (9e9, 9e9),
        corner, panel,
    )  # fmt: skip


def _stations(body: _Body) -> np.ndarray:
    """Where cross-sections stand: profile knots, wheel wells, rounded ends, door pillars."""
    end = body.top[-1, 0]
    reach = body.wheel_radius + 0.05
    wells = [x + reach * np.cos(np.linspace(np.pi, 0, 7)) for x in body.wheel_x]
    _, roof0, roof1, _ = body.glass_x
    pillar = (roof0 + roof1) / 2 + np.array((-0.06, 0.06))
    bed = [np.asarray(body.bed) + d for d in (-0.03, 0.0)] if body.bed[0] < end else []
    x = np.concatenate((
        body.top[:, 0], *wells, pillar, *bed,
        (0.04, 0.2, 0.4, end - 0.2, end - 0.4, end - 0.03), np.linspace(0, end, 6),
    ))  # fmt: skip
    x = np.unique(np.round(x[(x >= 0) & (x <= end)], 3))
    return x[np.concatenate(((True,), np.diff(x) > 0.008))]


def _half_width(body: _Body, x: np.ndarray) -> np.ndarray:
    """Half width at the widest height: rounded in plan at both bumpers."""
    end = body.top[-1, 0]
    front = np.clip(1 - x / 0.8, 0, 1)
    back = np.clip(1 - (end - x) / 0.6, 0, 1)
    return body.width / 2 - body.corner * (front**2.2 + 0.8 * back**2.2)


def _well(body: _Body, x: np.ndarray) -> np.ndarray:
    """Height of the body's lower edge: the floor, raised over the wheels."""
    reach = body.wheel_radius + 0.05
    arches = [np.sqrt(np.maximum(reach**2 - (x - w) ** 2, 0)) for w in body.wheel_x]
    arch = np.max(arches, axis=0)
    raised = np.maximum(body.floor, body.wheel_radius + arch - 1e-3)
    return np.where(arch > 0, raised, body.floor)


def _shell(body: _Body) -> Solid:
    """The body's skin: 24 points around each section, bottom middle first, leftwards up."""
    x = _stations(body)
    top = np.interp(x, body.top[:, 0], body.top[:, 1])
    _, roof0, roof1, _ = body.glass_x
    along = np.clip((x - roof0) / (roof1 - roof0), 0, 1)
    top = top + 0.1 * along * (1 - along)  # the roof is arched
    wide, well = _half_width(body, x), _well(body, x)
    belt = np.maximum(np.minimum(body.belt, top - 0.07), well + 0.06)
    rise = np.maximum(top - belt, 0.0)
    lean = body.tumble * np.maximum(top - body.belt, 0.0)
    shoulder = wide - 0.05 - lean
    inner = np.where((x > body.bed[0]) & (x < body.bed[1]), 0.45, 0.0)
    end = body.top[-1, 0]
    lift = np.clip(1 - x / 0.4, 0, 1) ** 2 + np.clip(1 - (end - x) / 0.4, 0, 1) ** 2
    floor = body.floor + 0.08 * lift  # bumpers end higher than the sills
    low = np.maximum(floor, well)
    third = (belt - low) / 3
    bulge = 0.02
    pane0, pane1 = belt + 0.12 * rise, belt + 0.86 * rise
    lines = (
        (0 * x, floor),
        (wide - 0.30, floor),
        (wide - 0.28, low),
        (wide - 0.03, low),
        (wide - 0.5 * bulge, low + third),
        (wide, low + 2 * third),
        (wide - 0.02, belt),
        (wide - 0.04 - 0.12 * (lean + 0.02), pane0),
        (shoulder, pane1),
        (shoulder - 0.07, top - 0.025),
        (shoulder - 0.16, top),
        (0.5 * shoulder, top + 0.012 - inner),
        (0 * x, top + 0.018 - inner),
    )
    left = np.stack([np.stack((-x, y, z), -1) for y, z in lines], 1)
    right = left[:, -2:0:-1] * (1, -1, 1)
    return loft(np.concatenate((left, right), 1), _panes(body, x))


def _panes(body: _Body, x: np.ndarray) -> np.ndarray:
    """Which patches of the shell are glass: `(s - 1, 24)`."""
    cowl, roof0, roof1, deck = body.glass_x
    middle = (x[1:] + x[:-1]) / 2
    pillar = np.abs(middle - (roof0 + roof1) / 2) < 0.07
    closed = (middle > (roof0 + roof1) / 2) & body.panel
    side = (middle > cowl + 0.25 * (roof0 - cowl)) & (middle < deck - 0.25 * (deck - roof1))
    screen = (middle > cowl) & (middle < roof0)
    rear = (middle > roof1) & (middle < deck) & (not body.panel)
    panes = np.zeros((len(middle), 24), bool)
    panes[:, [7, 16]] = (side & ~pillar & ~closed)[:, None]
    panes[:, 9:15] |= (screen | rear)[:, None]
    return panes


def _wheels(body: _Body) -> list[Solid]:
    r, wide = body.wheel_radius, 0.2 if body.kind != "truck" else 0.3
    wheels = []
    for x in body.wheel_x:
        under_body = x < body.top[-1, 0]
        outer = float(_half_width(body, np.array((x,)))[0]) if under_body else body.width / 2
        y = outer - 0.015
        for side in (-1, 1):
            start = np.array((-x, side * (y - wide), r))
            tip = np.array((-x, side * y, r))
            wheels.append(cylinder(start, tip, (r * 0.94, r, r, r, r, r * 0.94), 18))
    return wheels


def _mirrors(body: _Body) -> list[Solid]:
    cowl, roof0 = body.glass_x[:2]
    x = -(cowl + 0.45 * (roof0 - cowl))
    y = body.width / 2 + 0.07
    z = body.belt + 0.09
    half = (0.07, 0.11, 0.08) if body.kind != "truck" else (0.07, 0.1, 0.2)
    return [ellipsoid((x, side * y, z), half) for side in (-1, 1)]


def _cargo(body: _Body, rng: np.random.Generator) -> list[Solid]:
    """The truck's box (or low platform) and the frame under it."""
    start = body.top[-1, 0] + float(rng.uniform(0.1, 0.3))
    half = body.width / 2
    platform = rng.random() < 0.2
    top = 1.5 if platform else body.height * float(rng.uniform(0.97, 1.12))
    deck = 2 * body.wheel_radius + 0.1
    return [
        box((-body.length, -half, deck), (-start, half, min(top, 3.5))),
        box((-body.length + 0.1, -0.45, 0.45), (-body.top[-1, 0] + 0.4, 0.45, deck + 0.02)),
    ]
