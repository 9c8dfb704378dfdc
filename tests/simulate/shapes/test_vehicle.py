# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every procedural shape is a union of closed parts of plausible size."""

from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.shapes.unit_shapes import airplane, chair
from wildshape.simulate.shapes.variety import varied
from wildshape.simulate.shapes.vehicle import KINDS, random_vehicle, varied_vehicle, vehicle

_LONGEST = {
    "sedan": 5.2,
    "hatchback": 4.5,
    "van": 5.7,
    "pickup": 5.7,
    "truck": 9.1,
    "transporter": 7.1,
}


def _assert_closed(solid: Solid) -> None:
    for part in np.unique(solid.parts):
        mesh = trimesh.Trimesh(solid.vertices, solid.faces[solid.parts == part], process=False)
        mesh.remove_unreferenced_vertices()
        assert mesh.is_watertight, f"{solid.kind} part {part}"
        assert mesh.is_winding_consistent
        assert mesh.volume > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_vehicles_are_closed_and_of_real_size(kind: str, seed: int) -> None:
    solid = vehicle(kind, np.random.default_rng(seed))
    _assert_closed(solid)
    low, high = solid.bounds
    length, width, height = high - low
    assert abs(low[2]) < 1e-9
    assert 3.3 <= length <= _LONGEST[kind]
    assert 1.6 <= width <= 2.9
    assert 1.3 <= height <= 3.6
    assert 500 <= len(solid.faces) <= 3200
    assert 0 < solid.glass.mean() < 0.5


@pytest.mark.parametrize("maker", [airplane, chair])
@pytest.mark.parametrize("seed", range(8))
def test_unit_shapes_are_closed_and_unit(
    maker: Callable[[np.random.Generator], Solid], seed: int
) -> None:
    solid = maker(np.random.default_rng(seed))
    _assert_closed(solid)
    low, high = solid.bounds
    np.testing.assert_allclose(low + high, 0, atol=1e-9)
    assert np.linalg.norm(high - low) == pytest.approx(1.0)


def test_varied_vehicles_are_of_all_sizes_on_the_road() -> None:
    rng = np.random.default_rng(1)
    solids = [varied_vehicle(rng) for _ in range(120)]
    for solid in solids:
        assert solid.bounds.sum(0) == pytest.approx(0, abs=1e-9)
    sizes = np.array([np.ptp(solid.bounds, axis=0) for solid in solids])
    cars = sizes[[s.kind in ("sedan", "hatchback") for s in solids]]
    assert 3.39 < cars[:, 0].min() < 3.7
    assert 5.0 < cars[:, 0].max() <= 5.8
    vans = sizes[[s.kind in ("van", "transporter") for s in solids]]
    assert vans[:, 0].max() > 6
    assert vans[:, 2].max() > 2.5


def test_varied_vehicles_have_relief() -> None:
    def at_the_sides(solid: Solid) -> float:
        corners = solid.vertices[solid.faces[solid.parts == 0]]  # the shell
        edges = corners[:, 1:] - corners[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        depth = np.abs(corners[..., 1]).max() - np.abs(corners[..., 1]).mean(1)
        return float(area[depth < 0.05].sum() / area.sum())

    solids = [vehicle("sedan", np.random.default_rng(seed)).centred() for seed in range(20)]
    rounder = [varied(solid, np.random.default_rng(seed)) for seed, solid in enumerate(solids)]
    assert np.mean([*map(at_the_sides, rounder)]) < 0.9 * np.mean([*map(at_the_sides, solids)])


@pytest.mark.parametrize("kind", KINDS)
def test_front_and_back_differ(kind: str) -> None:
    solid = vehicle(kind, np.random.default_rng(3)).centred()
    body = solid.vertices[np.abs(solid.vertices[:, 1]) < 0.2]
    front = body[body[:, 0] > 0.25 * solid.bounds[1, 0], 2].mean()
    back = body[body[:, 0] < -0.25 * solid.bounds[1, 0], 2].mean()
    assert abs(front - back) > 0.02


def test_instances_differ_and_a_seed_repeats() -> None:
    one, same, other = (random_vehicle(np.random.default_rng(s)) for s in (5, 5, 6))
    np.testing.assert_array_equal(one.vertices, same.vertices)
    assert one.vertices.shape != other.vertices.shape or not np.allclose(
        one.vertices, other.vertices
    )
