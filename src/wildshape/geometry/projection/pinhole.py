# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pinhole cameras: x right, y down, z forward."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole camera, pixels: `u = fx x / z + cx`, `v = fy y / z + cy`."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int


def back_project(depth: Float[np.ndarray, "h w"], camera: Intrinsics) -> Float[np.ndarray, "n 3"]:
    """Points `(n, 3)` float32 of the pixels with a depth: x right, y down, z forward, metres.

    Args:
        depth: along the optical axis, metres; not finite or not positive where nothing was seen.
        camera: pixel i covers [i, i + 1), so that its ray leaves through i + 0.5.
    """
    v, u = np.nonzero(np.isfinite(depth) & (depth > 0))
    z = depth[v, u].astype(np.float64)
    x = (u + 0.5 - camera.cx) / camera.fx * z
    y = (v + 0.5 - camera.cy) / camera.fy * z
    return np.stack((x, y, z), axis=1).astype(np.float32)
