# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays beside an object as points with a kind."""

import pytest
import torch

from wildshape.geometry.projection.ray_points import ray_points

CENTRE = torch.tensor([10.0, 0.0, 0.0])


def points_of(ends, count=4, starts=None):
    return ray_points(torch.tensor(ends), CENTRE, count, depth_m=2.0, within_m=5.0, starts=starts)


def test_each_ray_says_what_became_of_it():
    """Past the object at its side, stopped before it, ended beside it; and one far away."""
    found = points_of([[40.0, 4.0, 0.0], [5.0, 0.0, 0.5], [9.0, 2.0, 0.0], [10.0, 60.0, 0.0]])
    assert found[:, 3:].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]
    torch.testing.assert_close(found[2, :3], torch.tensor([-1.0, 2.0, 0.0]))
    assert bool((found[3] == 0).all())
    # A ray that passes is known by the point of it that is nearest to the centre.
    for row, end in ((0, [40.0, 4.0, 0.0]), (1, [5.0, 0.0, 0.5])):
        direction = torch.nn.functional.normalize(torch.tensor(end), dim=0)
        at = found[row, :3] + CENTRE
        torch.testing.assert_close(
            torch.linalg.cross(at, direction), torch.zeros(3), atol=1e-5, rtol=0
        )
        assert float(found[row, :3] @ direction) == pytest.approx(0.0, abs=1e-5)


def test_more_rays_than_wanted_are_thinned_evenly():
    ends = [[10.0, 0.01 * i, 0.0] for i in range(100)]
    found = points_of(ends, count=10)
    assert found[:, 1].tolist() == pytest.approx([0.1 * i for i in range(10)], abs=1e-6)


def test_rays_may_start_elsewhere():
    """The whole scene moved: the same points."""
    ends, by = torch.tensor([[40.0, 4.0, 0.0], [5.0, 0.0, 0.5]]), torch.tensor([3.0, -2.0, 1.0])
    still = ray_points(ends, CENTRE, 2, depth_m=2.0, within_m=5.0)
    moved = ray_points(ends + by, CENTRE + by, 2, depth_m=2.0, within_m=5.0, starts=by.expand(2, 3))
    torch.testing.assert_close(still, moved, atol=1e-5, rtol=0)
