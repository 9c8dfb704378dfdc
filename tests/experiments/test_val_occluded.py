# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which scans are of the set: by the share of the rays through the object that ended before it."""

import numpy as np
import pytest
from experiments.val_occluded import blocked_share

from wildshape.geometry.projection.sight_lines import SightLines


def rays(count, height, ranges):
    """At a wall 10 m ahead, side by side, at a height."""
    ends = np.stack((np.full(count, 10.0), np.linspace(-0.9, 0.9, count), np.full(count, height)))
    directions = (ends / np.linalg.norm(ends, axis=0)).T.astype(np.float32)
    return directions, np.full(count, ranges, np.float32)


def test_rays_that_miss_the_object_or_go_through_it_are_not_blocked():
    """Of 100 rays at a wall 60 end before it; 25 return from it, 15 never; 50 pass above."""
    grid = np.arange(-1.0, 1.001, 0.05)
    y, z = (part.ravel() for part in np.meshgrid(grid, grid))
    wall = np.stack((np.full(len(y), 10.0), y, z), 1).astype(np.float32)
    towards, far = rays(25, 0.2, 1.0)
    parts = (rays(60, -0.5, 5.0), rays(15, 0.5, np.inf), rays(50, 3.0, 5.0), rays(20, 3.0, np.inf))
    others = SightLines.joined(tuple(SightLines(*part) for part in parts))
    scan = towards * (10.0 / towards[:, :1]) * far[:, None]
    assert blocked_share(scan, others, wall) == pytest.approx(0.6)
