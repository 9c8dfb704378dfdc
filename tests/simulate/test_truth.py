# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The truth shape is the outer visible surface, evenly covered."""

import numpy as np
import pytest

from wildshape.errors import BadInputError
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import Solid, box, union
from wildshape.simulate.truth import visible_surface


def _shape(solid: Solid, lowest: float, count: int = 3000) -> np.ndarray:
    return visible_surface(solid, Scene([solid]), count, lowest, np.random.default_rng(0))


def test_nothing_inside_a_closed_body() -> None:
    hidden = union(
        [box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)), box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))]
    )
    points = _shape(hidden, -90.0)
    np.testing.assert_allclose(np.abs(points).max(1), 1.0, atol=1e-6)


def test_the_underside_is_left_out_for_a_lidar_only() -> None:
    cube = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    assert (_shape(cube, 0.0)[:, 2] > -1 + 1e-6).mean() > 0.99
    assert (_shape(cube, -90.0)[:, 2] < -1 + 1e-6).mean() == pytest.approx(1 / 6, abs=0.02)


def test_density_is_uniform_by_area() -> None:
    slab = box((-2.0, -1.0, -0.5), (2.0, 1.0, 0.5))
    points = _shape(slab, -90.0, 8192)
    area = np.array((2.0, 4.0, 8.0))  # the pairs of faces across x, y, z: 2, 4 and 8 square metres
    side = np.argmax(np.abs(points) / (2, 1, 0.5), axis=1)
    share = np.bincount(side, minlength=3) / len(points)
    np.testing.assert_allclose(share, area / area.sum(), atol=0.01)


def test_a_mesh_without_any_surface_is_refused() -> None:
    inner = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    outer = box((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0))
    with pytest.raises(BadInputError, match="to the outside"):
        visible_surface(inner, Scene([inner, outer]), 100, -5.0, np.random.default_rng(0))
