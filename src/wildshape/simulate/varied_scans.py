# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Sensors that differ from track to track, and scans cut as real ones are."""

from dataclasses import replace

import numpy as np

from wildshape.simulate.scan import Returns, Turn
from wildshape.simulate.shapes.solid import Solid

_CUT, _CUT_M = 0.5, (0.05, 0.35)


def varied_returns(usual: Returns, rng: np.random.Generator) -> Returns:
    """Noise of half to two and a half times the usual, more losses, glass from clear to dusty."""
    return replace(
        usual,
        noise_m=usual.noise_m * float(np.exp(rng.uniform(np.log(0.5), np.log(2.5)))),
        dropout=usual.dropout + float(rng.uniform(0.0, 0.25)),
        glass=float(rng.uniform(0.02, 0.7)),
        grazing=float(rng.uniform(0.05, 0.25)),
        through=float(rng.uniform(0.0, 0.8)),
    )


def cut_above_ground(
    turn: Turn, T_object_sensor: np.ndarray, target: Solid, rng: np.random.Generator
) -> Turn:
    """Half of the scans without what lies just above the ground, which crops leave out."""
    cut, height = rng.random() < _CUT, rng.uniform(*_CUT_M)
    if not cut:
        return turn
    z = turn.points @ T_object_sensor[2, :3] + T_object_sensor[2, 3]
    kept = turn.points[z > target.bounds[0, 2] + height]
    return turn._replace(points=kept, on_target=min(turn.on_target, len(kept)))
