# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of clouds: the compiled kernel and the trees against steps taken one by one."""

import numpy as np
import pytest

from wildshape.ops.connected import connected_parts, connected_trees
from wildshape.ops.library import connected_kernel


def by_steps(points, reach):
    """Spread from each point that has no part yet, one step at a time."""
    near = np.linalg.norm(points[:, None] - points[None], axis=2) <= reach
    part = np.full(len(points), -1)
    for start in range(len(points)):
        if part[start] < 0:
            reached = np.arange(len(points)) == start
            while (grown := near[reached].any(0)).sum() > reached.sum():
                reached = grown
            part[reached] = part.max() + 1
    return part


@pytest.mark.parametrize("reach", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("trees", [False, True])
def test_parts_are_what_steps_reach(monkeypatch, reach, trees):
    if trees:
        monkeypatch.setattr("wildshape.ops.connected.connected_kernel", lambda: None)
    rng = np.random.default_rng(3)
    centres = rng.uniform(-4, 4, (12, 1, 3))
    points = (centres + rng.normal(scale=0.3, size=(12, 25, 3))).reshape(-1, 3).astype(np.float32)
    rng.shuffle(points)
    np.testing.assert_array_equal(connected_parts(points, reach), by_steps(points, reach))


@pytest.mark.skipif(connected_kernel() is None, reason="native library not built")
def test_many_points_as_trees_have_it():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 10, (20_000, 3)).astype(np.float32)
    own, trees = connected_parts(points, 0.4), connected_trees(points, 0.4)
    assert len(np.unique(own)) == len(np.unique(trees)) == len(np.unique(own * 20_000 + trees))


def test_none_and_one():
    assert connected_parts(np.zeros((0, 3), np.float32), 1.0).shape == (0,)
    assert connected_parts(np.zeros((1, 3), np.float32), 1.0).tolist() == [0]
