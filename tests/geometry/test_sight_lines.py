# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays around an object, and what they say of points, against a plain search."""

import numpy as np
import torch
from tests.refusal import refused

from wildshape.geometry.projection.sight_lines import SightLines, seen_alike, standing
from wildshape.geometry.transforms.rotation import rotation_z


def some_rays(count: int, seed: int = 0, origins: np.ndarray | None = None) -> SightLines:
    rng = np.random.default_rng(seed)
    away = np.array((10.0, 0.0, 0.0)) + rng.normal(0, 1.5, (count, 3))
    directions = away / np.linalg.norm(away, axis=1, keepdims=True)
    ranges = np.where(rng.random(count) < 0.2, np.inf, rng.uniform(5, 20, count))
    return SightLines(directions, ranges, origins)


def plainly(points, scan, rays, beyond_m=0.1, within_m=0.15, nearest=3):
    """`standing`, point by point and ray by ray; one sensor."""
    own = SightLines.of_returns(scan)
    came = rays.returned
    every = SightLines.joined((own, came))
    free, hidden = [], []
    for point in points:
        away = np.linalg.norm(point)
        apart = away * np.linalg.norm(every.directions - point / away, axis=1)
        near = [ray for ray in np.argsort(apart)[:nearest] if apart[ray] <= within_m]
        passed = [every.ranges[ray] - away for ray in near]
        others = all(ray >= len(own) for ray in near)
        free.append(len(near) > 0 and min(passed) > beyond_m)
        hidden.append(len(near) > 0 and others and max(passed) < -beyond_m)
    return np.array(free), np.array(hidden)


def some_points(count: int, seed: int, spread: float = 1.0) -> np.ndarray:
    return np.array((10.0, 0.0, 0.0)) + np.random.default_rng(seed).normal(0, spread, (count, 3))


def test_standing_is_what_the_nearest_rays_say_one_by_one() -> None:
    rays, scan, points = some_rays(400), some_points(50, 2, 0.5), some_points(300, 1)
    found, (free, hidden) = standing(points, scan, rays), plainly(points, scan, rays)
    assert 10 < free.sum() < 200
    assert 10 < hidden.sum() < 200
    assert (found.free == free).all()
    assert (found.hidden == hidden).all()
    nothing = rays.part(np.zeros(0, int))
    assert (standing(points, scan, nothing).free == plainly(points, scan, nothing)[0]).all()


def test_what_one_of_several_sensors_saw_through_is_free() -> None:
    """One sees the point hidden behind something, the other sees past it."""
    point, scan = np.array([[10.0, 0.0, 0.0]]), np.array([[10.0, 4.0, 0.0]])
    starts = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.float32)
    ends = starts + np.array((0.4, 1.6))[:, None] * (point - starts)
    for order in ([0, 1], [1, 0]):
        found = standing(point, scan, SightLines.of_returns(ends[order], starts[order]))
        assert found.free.all()
        assert not found.hidden.any()
    assert standing(point, scan, SightLines.of_returns(ends[:1])).hidden.all()


def test_what_sensors_on_two_sides_saw_is_not_free() -> None:
    """Each sees its own side of a vehicle; the other side's returns lie behind what it saw."""
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(8, 12, 60), np.linspace(-1.5, 0, 30)))
    sides = [np.stack((x, np.full_like(x, side), z), 1) for side in (-0.9, 0.9)]
    starts = np.array([[10.0, -8.0, 1.0], [10.0, 8.0, 1.0]])
    scan = np.concatenate(sides)
    beyond = [np.array([[10.0, 0.0, 4.0]]) * 2 - start for start in starts]
    rays = SightLines.of_returns(np.concatenate(beyond), starts)
    between = scan + np.array((0.034, 0.0, 0.026))  # the returns
    assert standing(between, scan, rays).free.mean() < 0.01
    outside = np.array([[10.0, 0.0, 4.0]])  # where both sensors' rays passed
    assert standing(outside, scan, rays).free.all()


def test_places_within_45_degrees_around_an_object_see_the_same_side() -> None:
    middle, angles = np.array((3.0, -2.0, 1.0)), np.radians((0, 30, 44, 46, 89, 180, -44, -46))
    around = np.stack((np.cos(angles), np.sin(angles), 0 * angles), axis=1)
    expected = [True, True, True, False, False, False, True, False]
    for near, far in ((0.2, 0.5), (5.0, 30.0), (30.0, 5.0)):
        found = seen_alike(middle + far * around, middle + near * around[0], middle)
        assert found.tolist() == expected


def test_rays_move_with_what_they_are_held_against() -> None:
    rays, scan, points = some_rays(400), some_points(50, 2, 0.5), some_points(300, 1)
    turn = rotation_z(torch.tensor(2.0)).double().numpy()
    here = standing(points, scan, rays)
    for shift in (np.zeros(3), np.array((3.0, -4.0, 1.0))):
        moved = rays.moved(turn, shift)
        assert (moved.origins is None) == (not shift.any())
        there = standing(points @ turn.T + shift, scan @ turn.T + shift, moved)
        assert (here.free == there.free).mean() > 0.98  # rounding of origins turns a few
        assert (here.hidden == there.hidden).mean() > 0.98


def test_rays_of_several_sensors_start_and_end_where_a_move_takes_them() -> None:
    starts = np.random.default_rng(3).uniform(-2, 2, (50, 3))
    rays = some_rays(50, origins=starts)
    turn = rotation_z(torch.tensor(2.0)).double().numpy()
    for shift in (np.zeros(3), np.array((3.0, -4.0, 1.0))):
        moved = rays.moved(turn, shift)
        np.testing.assert_allclose(moved.starts, starts @ turn.T + shift, atol=1e-5)
        ends, before = moved.returned.ends, rays.returned.ends
        np.testing.assert_allclose(ends, before @ turn.T + shift, atol=1e-4)


def test_what_are_no_rays_is_refused() -> None:
    unit = np.eye(3)
    refused(SightLines, 2 * unit, np.ones(3), match="no unit vector")
    refused(SightLines, unit, np.ones(2), match=r"\(3, 3\) do not fit ranges \(2,\)")
    for bad in (0.0, -1.0, np.nan):
        refused(SightLines, unit, np.array((1.0, 2.0, bad)), match="not above 0")
    refused(SightLines, unit, np.ones(3), np.full((3, 3), np.inf), match="origin is not finite")
    refused(SightLines, np.array([["a"]]), np.ones(1), match="no array of numbers")
