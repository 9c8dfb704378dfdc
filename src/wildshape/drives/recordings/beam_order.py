# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When a turning sensor met its points, where nothing but their order in the file tells it.

Files that keep the order of firing hold one column of beams after the other: the azimuth of the
rows goes once around. nuScenes' sweeps are such, but nowhere is that promised. So it is looked at.
"""

import numpy as np
from jaxtyping import Float

from wildshape.records import Points

_COLUMNS = 128  # rows together: of some columns of beams
_FEWEST = 32  # such blocks: 11 degrees each
_ONE_WAY = 0.95  # of the blocks follow each other in one sense
_TURN = (0.85, 1.15)  # that the blocks take together, turns
_WITHIN = np.deg2rad(10.0)  # half of the points are nearer to their block's azimuth


def met_in_order(points: Points, turn_s: float) -> Float[np.ndarray, "n"] | None:
    """When each point was met, since the middle of the turn, seconds; None if the order tells not.

    Args:
        points: `(n, 3)` a whole turn as its file lists it, sensor frame.
        turn_s: how long the sensor takes for a turn.
    """
    blocks = len(points) // _COLUMNS
    if blocks < _FEWEST:
        return None
    azimuth = np.arctan2(points[:, 1], points[:, 0]).astype(np.float64)
    block = np.minimum(np.arange(len(points)) // _COLUMNS, blocks - 1)
    x, y = (np.bincount(block, of(azimuth)) for of in (np.cos, np.sin))
    middle = np.arctan2(y, x)
    steps = _wrapped(np.diff(middle))
    turned = steps.sum()
    sense = np.sign(turned)
    around = abs(turned) / (2 * np.pi) * blocks / (blocks - 1)
    off = _wrapped(azimuth - middle[block])
    in_order = (steps * sense > 0).mean() >= _ONE_WAY and np.median(np.abs(off)) < _WITHIN
    if not in_order or not _TURN[0] < around < _TURN[1]:
        return None
    since = sense * (np.concatenate(([0.0], np.cumsum(steps)))[block] + off)
    return turn_s * (since - sense * turned / 2) / (2 * np.pi)


def _wrapped(angle: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """From -pi to pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
