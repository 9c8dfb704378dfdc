# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Parts of clouds: the compiled kernel and the trees against steps taken one by one."""

import numpy as np
import pytest

from wildshape.ops.connected import connected_parts, connected_trees, first_of_cells, first_sorted
from wildshape.ops.library import added_kernel


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


def some_groups(seed=3):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-4, 4, (12, 1, 3))
    points = (centres + rng.normal(scale=0.3, size=(12, 25, 3))).reshape(-1, 3).astype(np.float32)
    rng.shuffle(points)
    return points


@pytest.fixture(params=[False, True], ids=["kernel", "trees"])
def either(request, monkeypatch):
    if request.param:
        monkeypatch.setattr("wildshape.ops.connected.added_kernel", lambda _: None)


@pytest.mark.parametrize("reach", [0.05, 0.3, 1.0])
@pytest.mark.usefixtures("either")
def test_parts_are_what_steps_reach(reach):
    points = some_groups()
    found = connected_parts(points, reach, 1e-3 * reach)
    np.testing.assert_array_equal(found, by_steps(points, reach))


@pytest.mark.usefixtures("either")
def test_pairs_are_one_part_and_so_are_the_points_of_a_cell():
    points = np.array([[9.9, 0, 0], [0, 0, 0], [5, 0, 0], [9, 0, 0]], np.float32)
    pairs = np.array([[2, 1]])
    assert connected_parts(points, 0.1, 0.01).tolist() == [0, 1, 2, 3]
    assert connected_parts(points, 0.1, 0.01, pairs).tolist() == [0, 1, 1, 2]
    assert connected_parts(points, 0.1, 1.0).tolist() == [0, 1, 2, 0]


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("outside", [-1, 3, 2**40])
def test_pairs_of_points_that_are_not_there_are_refused(outside):
    with pytest.raises(IndexError, match="outside of 3"):
        connected_parts(np.eye(3, dtype=np.float32), 0.1, 0.01, np.array([[0, outside]]))


@pytest.mark.usefixtures("either")
def test_steps_of_the_whole_reach_count_and_longer_ones_across_a_cube_do_not():
    ends = np.array([[0, 0, 0], [3, 4, 0]], np.float32)
    assert connected_parts(ends, 5.0, 0.1).tolist() == [0, 0]
    assert connected_parts(ends, 4.99, 0.1).tolist() == [0, 1]
    corners = np.array([[0, 0, 0], [0.59, 0.59, 0.59]], np.float32)
    assert connected_parts(corners, 1.0, 0.3).tolist() == [0, 1]


@pytest.mark.skipif(added_kernel("parts") is None, reason="native library not built")
@pytest.mark.parametrize("cell", [0.002, 0.1, 0.3])
def test_many_points_as_trees_have_it(cell):
    rng = np.random.default_rng(0)
    points = rng.uniform(-5, 5, (20_000, 3)).astype(np.float32)
    pairs = rng.integers(20_000, size=(9, 2))
    own, trees = (of(points, 0.4, cell, pairs) for of in (connected_parts, connected_trees))
    np.testing.assert_array_equal(own, trees)
    assert own.max() > 100


def test_none_and_one():
    assert connected_parts(np.zeros((0, 3), np.float32), 1.0, 0.1).shape == (0,)
    assert connected_parts(np.zeros((1, 3), np.float32), 1.0, 0.1).tolist() == [0]


@pytest.mark.skipif(added_kernel("cells") is None, reason="no kernels")
@pytest.mark.parametrize("cell", [0.05, 0.4, 3.0])
def test_the_first_point_of_each_cell_is_the_same_with_the_kernel_and_by_sorting(cell):
    points = some_groups()
    rows = first_of_cells(points, cell)
    assert np.array_equal(rows, first_sorted(points, cell))
    assert len(np.unique(np.floor(points[rows] / np.float32(cell)), axis=0)) == len(rows)
    assert len(first_of_cells(points[:0], cell)) == 0
