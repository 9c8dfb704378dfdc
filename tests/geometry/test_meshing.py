# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes are closed, lie on the points, and are solid where no sensor could look."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

from wildshape.errors import BadInputError
from wildshape.geometry.meshing import closed_mesh, off_level
from wildshape.inference.predictor import load


def ball(count, rng):
    points = rng.normal(size=(count, 3))
    return (points / np.linalg.norm(points, axis=1, keepdims=True)).astype(np.float32)


def test_ball_has_the_volume_of_a_ball():
    points = ball(4000, np.random.default_rng(0))
    mesh = closed_mesh(points)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.05)
    off = np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1)
    assert np.quantile(off, 0.95) < 0.03


def test_open_below_is_filled():
    """Half a ball without its floor, as a car's shape is: solid all the same."""
    points = ball(6000, np.random.default_rng(1))
    mesh = closed_mesh(points[points[:, 2] > 0])
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(2 / 3 * np.pi, rel=0.1)


@pytest.mark.parametrize("count", [300, 512, 1024, 8192])
def test_few_points_are_no_hollow_shell(count):
    """At 512 points, as small networks give, half of the volume was missing."""
    rng = np.random.default_rng(0)
    body = trimesh.creation.box((4.4, 1.8, 1.5))
    mesh = closed_mesh(np.asarray(trimesh.sample.sample_surface(body, count, seed=rng)[0]))
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert mesh.volume == pytest.approx(body.volume, rel=0.12)


def test_scale_changes_nothing_else():
    points = ball(2000, np.random.default_rng(2))
    small, large = closed_mesh(points), closed_mesh(points * 8)
    assert large.volume == pytest.approx(512 * small.volume, rel=1e-3)


def test_crumbs_are_left_out():
    points = ball(3000, np.random.default_rng(3))
    stray = points[:20] * 0.02 + np.array([1.8, 0, 0], np.float32)
    mesh = closed_mesh(np.concatenate([points, stray]))
    assert mesh.vertices[:, 0].max() < 1.2


def test_seats_behind_glass_dent_no_window():
    """A window has few points, and what is seen through it lies 0.2 m deeper."""
    rng = np.random.default_rng(4)
    body = trimesh.creation.box((4.4, 1.8, 1.5))
    points = np.asarray(trimesh.sample.sample_surface(body, 8000, seed=rng)[0])
    window = (np.abs(points[:, 0]) < 0.4) & (np.abs(points[:, 2]) < 0.3) & (points[:, 1] > 0.85)
    glass = points[window]
    seats = glass[::2] - np.array([0, 0.2, 0])
    mesh = closed_mesh(np.concatenate((points[~window], glass[::4], seats)))
    there = mesh.vertices[(np.abs(mesh.vertices[:, [0, 2]]) < 0.2).all(1)]
    assert there[there[:, 1] > 0, 1].min() > 0.85


def test_one_place_is_no_shape():
    with pytest.raises(BadInputError, match="all equal"):
        closed_mesh(np.ones((20, 3), np.float32))


def test_corners_of_the_surface_stay_apart():
    """Where the field of a grid is just the level, corners would fall together."""
    field = np.abs(np.indices((9, 9, 9)) - 4.0).sum(0)  # whole numbers, and so is the level

    def corners(field):
        vertices, faces, *_ = marching_cubes(field, 3.0)
        closed = trimesh.Trimesh(vertices, faces, process=True).is_watertight
        return len(vertices) - len(np.unique(vertices.astype(np.float32), axis=0)), closed

    assert corners(field)[0] > 0
    assert corners(off_level(field, 3.0, 1e-3)) == (0, True)


def test_completions_close(cars):
    done = load().complete(cars[0].scans[3])
    mesh = done.mesh()
    assert mesh.is_watertight
    assert mesh.volume > 0
    box = np.asarray(done.box.centre)
    assert np.linalg.norm(mesh.bounds.mean(0) - box) < 0.5
    assert mesh.body_count == 1, "bubbles or crumbs"
    apart, _ = KDTree(mesh.sample(20_000, seed=0)).query(done.points)
    assert np.median(apart) < 0.03
    assert np.quantile(apart, 0.95) < 0.09
