# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles made other ones: of another size, and with relief.

Of the points on KITTI's cars half lie within 10 cm of their labelled boxes, on our procedural ones
three quarters: real sides belly, ends lean and cabins narrow upwards. Their corners are sharper.
"""

from dataclasses import dataclass, replace

import numpy as np

from wildshape.simulate.shapes.solid import Solid

_SHORTEST_M = 3.4


@dataclass(frozen=True)
class Variety:
    """How far a vehicle may be changed.

    Attributes:
        stretch: of length, width and height, a share up or down.
        taper: how much narrower a vehicle's ends are than its middle, a share at most.
        belly: how much narrower its sills and shoulders are than its belt, a share at most.
        cabin: how much narrower its roof is than its belt, a share at most.
        end_m: how far its ends stand back at the corners, metres at most.
        lean_m: how far they stand back at the top or the bottom, metres at most.
    """

    stretch: tuple[float, float, float] = (0.08, 0.08, 0.06)
    taper: float = 0.16
    belly: float = 0.12
    cabin: float = 0.3
    end_m: float = 0.15
    lean_m: float = 0.2


_USUAL = Variety()


def varied(solid: Solid, rng: np.random.Generator) -> Solid:
    """Another vehicle of the same build, its box centre at the origin."""
    size = np.ptp(solid.bounds, axis=0)
    wanted = size * (1 + np.array(_USUAL.stretch) * rng.uniform(-1, 1, 3))
    wanted[0] = max(wanted[0], min(size[0], _SHORTEST_M))
    at = (solid.vertices - solid.bounds.mean(0)) / (size / 2)  # -1 to 1
    rounder = _rounded(at, wanted[0] / 2, rng)
    return replace(solid, vertices=rounder * wanted / np.ptp(rounder, axis=0)).centred()


def _rounded(at: np.ndarray, half_m: float, rng: np.random.Generator) -> np.ndarray:
    """Vertices `(v, 3)` in a box from -1 to 1, drawn in at its ends, its roof and its corners."""
    x, y, z = at.T
    taper, belly, cabin = rng.uniform(0, (_USUAL.taper, _USUAL.belly, _USUAL.cabin))
    begins, widest = rng.uniform((0.3, -0.4), (0.7, 0.1))
    narrow = 1 - taper * np.clip((np.abs(x) - begins) / (1 - begins), 0, 1)
    narrow = narrow - belly * (z - widest) ** 2 - cabin * np.clip(z, 0, 1) ** 2
    back = np.zeros_like(x)
    for end in (-1, 1):
        round_m, lean_m = rng.uniform((0, -_USUAL.lean_m), (_USUAL.end_m, _USUAL.lean_m))
        lean = np.abs(lean_m) * np.clip(np.sign(lean_m) * z, 0, 1)
        near = np.clip(end * x, 0, 1) ** 2
        back += end * near * (round_m * np.abs(y) ** 2.5 + lean)
    return np.stack((x - back / half_m, y * narrow, z), -1)
