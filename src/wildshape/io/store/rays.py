# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rays of a scan as rows of a packed store (`layout.py`)."""

from typing import Any

import numpy as np
from jaxtyping import Float32

from wildshape.geometry.projection.sight_lines import SightLines


def rows_of_rays(rays: SightLines) -> Float32[np.ndarray, "k 3"]:
    """Directions, ranges and, if there are any, origins."""
    count = len(rays)
    ranges = np.zeros((_range_rows(count), 3), np.float32)
    ranges.reshape(-1)[:count] = np.where(np.isfinite(rays.ranges), rays.ranges, 0.0)
    origins = [] if rays.origins is None else [rays.origins]
    return np.concatenate((rays.directions, ranges, *origins))


def rays_of_rows(rows: Float32[np.ndarray, "k 3"], count: int) -> SightLines:
    """The `count` rays that `rows_of_rays` packed.

    Raises:
        BadInputError: they are no rays.
    """
    packed = rows[count : count + _range_rows(count)].reshape(-1)[:count]
    origins = rows[count + _range_rows(count) :]
    ranges = np.where(packed > 0, packed, np.inf)
    return SightLines(rows[:count], ranges, origins if len(origins) else None)


def rows_that_fit(count: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Whether so many rays take so many rows, with origins or without; elementwise."""
    least = count + _range_rows(count)
    return (count >= 0) & ((rows == least) | (rows == least + count))


def _range_rows(count: Any) -> Any:
    return -(-count // 3)
