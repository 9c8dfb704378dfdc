# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays around an object, against a plain search over all of them."""

import numpy as np
import pytest
import torch
from tests.refusal import refused

from wildshape.geometry.projection.sight_lines import SightLines, nearest_rays, rays_near
from wildshape.geometry.transforms.rotation import rotation_z


def some_rays(count: int, seed: int = 0, origins: np.ndarray | None = None) -> SightLines:
    rng = np.random.default_rng(seed)
    away = np.array((10.0, 0.0, 0.0)) + rng.normal(0, 1.5, (count, 3))
    directions = away / np.linalg.norm(away, axis=1, keepdims=True)
    ranges = np.where(rng.random(count) < 0.2, np.inf, rng.uniform(5, 20, count))
    return SightLines(directions, ranges, origins)


def test_the_nearest_ray_is_that_of_a_search_over_all() -> None:
    rays = some_rays(200)
    points = np.array((10.0, 0.0, 0.0)) + np.random.default_rng(1).normal(0, 1, (300, 3))
    found = nearest_rays(points, rays, within_m=0.15)
    for point, ray, beyond in zip(points, *found):
        away = np.linalg.norm(point)
        # Of unit vectors the nearest has the largest product.
        best = int((rays.directions @ point).argmax())
        apart = away * np.linalg.norm(rays.directions[best] - point / away)
        assert ray == (best if apart <= 0.15 else -1)
        if ray >= 0:
            assert beyond == pytest.approx(rays.ranges[ray] - away)
        else:
            assert np.isnan(beyond)


def test_of_several_sensors_the_one_that_saw_past_a_point_is_believed() -> None:
    """One sees the point hidden behind something, the other sees past it."""
    point = np.array([[10.0, 0.0, 0.0]])
    starts = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
    ends = starts + np.array((0.4, 1.6))[:, None] * (point - starts)
    for order in ([0, 1], [1, 0]):
        rays = SightLines.of_returns(ends[order], starts[order])
        found = nearest_rays(point, rays)
        assert order[found.ray[0]] == 1
        assert found.beyond[0] == pytest.approx(0.6 * np.linalg.norm(point[0] - starts[1]))


def test_rays_move_with_what_they_are_held_against() -> None:
    rays = some_rays(100)
    points = np.array((10.0, 0.0, 0.0)) + np.random.default_rng(1).normal(0, 1, (50, 3))
    turn = rotation_z(torch.tensor(2.0)).double().numpy()
    for shift in (np.zeros(3), np.array((3.0, -4.0, 1.0))):
        moved = rays.moved(turn, shift)
        assert (moved.origins is None) == (not shift.any())
        here, there = nearest_rays(points, rays), nearest_rays(points @ turn.T + shift, moved)
        assert (here.ray == there.ray).all()
        assert np.allclose(here.beyond, there.beyond, atol=1e-3, equal_nan=True)


def test_rays_are_kept_around_the_object_and_not_elsewhere() -> None:
    rng = np.random.default_rng(0)
    frame = rng.uniform(-30, 30, (60_000, 3)).astype(np.float32)
    own = np.flatnonzero((np.abs(frame - (-12, 0.5, 0)) < (1, 1, 0.7)).all(1))  # at the seam
    rows = rays_near(frame, own, most=50)
    assert len(rows) == 50
    assert not set(rows) & set(own)
    assert (np.diff(rows) > 0).all()
    azimuth = np.arctan2(frame[rows, 1], -frame[rows, 0])
    assert (np.abs(azimuth) < np.arctan2(1.5, 11) + 1 / 10).all()
    assert (np.arctan2(frame[rows, 2], np.hypot(*frame[rows, :2].T)) < 0.2).all()
    everything = rays_near(frame, own, most=10**6)
    assert set(rows) < set(everything)


def test_what_are_no_rays_is_refused() -> None:
    unit = np.eye(3)
    refused(SightLines, 2 * unit, np.ones(3), match="no unit vector")
    refused(SightLines, unit, np.ones(2), match=r"\(3, 3\) do not fit ranges \(2,\)")
    refused(SightLines, unit, np.array((1.0, 0.0, np.nan)), match="not above 0")
    refused(SightLines, unit, np.ones(3), np.full((3, 3), np.inf), match="origin is not finite")
    refused(SightLines, np.array([["a"]]), np.ones(1), match="no array of numbers")
