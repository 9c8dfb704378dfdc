# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a LiDAR's scan is one object's, alone, seen from one place; known without labels.

The probabilities do not say so: no scan that they were fitted to was cut out so badly. Three things
do: points that the completed shape leaves over (`points_off_shape`: ground, walls), directions in
which two ranges were measured (`not_one_scan`: several frames put together), and a roof that the
sensor looked down on and did not see (`roof_not_seen`: two cars one after the other, or a car with
its trailer, pass for a lorry).
"""

import math

import numpy as np
import torch

from wildshape.geometry.box import box_axes
from wildshape.geometry.sampling import quantiles
from wildshape.ops.nearest import nearest, nearest_k
from wildshape.records import Box, Points

_OUTERMOST = 0.01  # share of the points that may be strays above a roof


def share_off(scan: Points, points: Points, far: float) -> float:
    """Share of a scan that lies farther than `far` metres from a shape's points, the same frame."""
    # Near the origin float32 keeps its digits.
    origin = scan.mean(axis=0, dtype=np.float64)
    near = [torch.from_numpy((part - origin).astype(np.float32))[None] for part in (scan, points)]
    return float((nearest(*near).distance_squared > far**2).double().mean())


def share_twice(scan: Points, alike_deg: float, far: float) -> float:
    """Share of a scan's points in whose direction another lies `far` metres nearer or farther.

    A ray ends once: points of one scan lie in directions of their own. Where the sensor's grid is
    finer than `alike_deg`, neighbours in it differ so much at few edges.

    Args:
        scan: sensor frame, metres.
        alike_deg: directions so near each other are one.
        far: metres.
    """
    ranges = np.linalg.norm(scan.astype(np.float64), axis=1)
    directions = torch.from_numpy((scan / ranges[:, None]).astype(np.float32))
    index = nearest_k(directions[None], directions[None], 2).index[0]  # most often itself, another
    chord = (directions[index] - directions[:, None]).norm(dim=-1).numpy()
    apart = np.abs(ranges[index.numpy()] - ranges[:, None])
    found = (chord < math.radians(alike_deg)) & (apart > far)
    return float(found.any(axis=1).mean())


def looked_down_on(scan: Points) -> bool:
    """Whether all of a scan lies below the sensor's own level, but for strays."""
    up = scan[:, 2] / np.linalg.norm(scan, axis=1)
    return quantiles(up[None], (1 - _OUTERMOST,)).item() < 0


def unseen_height(seen: Points, box: Box) -> float:
    """How far a box rises above all that was seen, but for strays, metres."""
    up = box_axes(box.quaternion_wxyz)[:, 2]
    height = (seen - np.asarray(box.centre)) @ up
    return box.size[2] / 2 - quantiles(height[None], (1 - _OUTERMOST,)).item()
