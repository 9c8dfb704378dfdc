# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training meshes: only those that weights may be made from, credited; copies of other sizes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from experiments.mesh_credits import notice
from experiments.meshes import (
    COPY_STRETCH,
    ROAD_SIZES,
    road_vehicles,
    stretched,
    unseen_vehicles,
    warped,
)

from wildshape.errors import BadInputError


def boxes(folder: Path) -> dict[str, list[np.ndarray]]:
    """Sizes of the meshes in a folder, by the mesh they come from, in order."""
    found: dict[str, list[np.ndarray]] = {}
    for path in sorted(folder.iterdir()):
        size = np.ptp(np.asarray(trimesh.load_mesh(path).vertices), axis=0)
        found.setdefault(path.stem.split("_", 1)[1], []).append(size)
    return found


def test_copies_are_stretched_and_one_is_the_mesh_itself(cad, tmp_path):
    assert stretched(cad, tmp_path, "car", 5, seed=3) == 1
    sizes = boxes(tmp_path)
    assert set(sizes) == {"red"}
    assert len(sizes["red"]) == 5
    shares = np.stack(sizes["red"]) / (4.5, 2.9, 3.1)
    assert (np.abs(shares - 1).max(axis=1) < 1e-6).sum() == 1
    assert (np.abs(shares - 1) <= COPY_STRETCH + 1e-6).all()
    assert np.ptp(shares, axis=0).min() > 0.01


def test_buses_are_drawn_four_times_as_often_and_copies_fit_on_roads(cad, tmp_path):
    road_vehicles(cad, tmp_path, 15, seed=0)
    sizes = boxes(tmp_path)
    assert {name: len(found) for name, found in sizes.items()} == {"red": 3, "big": 12}
    own = {"red": (4.5, 2.9, 3.1), "big": (9.0, 5.0, 2.0)}
    for name, found in sizes.items():
        low, high = (np.asarray(m) for m in (limits(name).least_m, limits(name).most_m))
        fits = [bool(((low - 1e-4 <= s) & (s <= high + 1e-4)).all()) for s in found]
        themselves = [np.allclose(s, own[name], atol=1e-4) for s in found]
        assert sum(themselves) == 1
        assert sum(fits) == len(found) - 1


def test_unseen_vehicles_are_of_the_test_split_and_fit_on_roads(cad, tmp_path):
    own = (cad / "manifest.csv").read_text("utf-8").replace("blue.ply,test", "red.ply,test")
    for name, text, size in (("blue", None, (4.0, 1.8, 1.5)), ("red", own, (4.5, 2.1, 2.1))):
        folder = tmp_path / name
        folder.mkdir()
        for path in cad.glob("*.ply"):
            (folder / path.name).symlink_to(path)
        (folder / "manifest.csv").write_text(text or (cad / "manifest.csv").read_text("utf-8"))
        unseen_vehicles(folder, folder / "out")
        ((found,),) = boxes(folder / "out").values()
        np.testing.assert_allclose(found, size, atol=1e-4)


def limits(name):
    return ROAD_SIZES["car" if name == "red" else "bus"]


def test_the_notice_credits_what_asks_for_it_and_nobody_is_left_out(cad, tmp_path):
    credited, free = notice(cad).split("public domain")
    assert 'car "red", CC-BY-3.0, by Nathan Koenig' in credited
    assert "big" in free
    assert not {"gnu", "blue"} & set(notice(cad).replace(",", " ").split())
    manifest = (cad / "manifest.csv").read_text("utf-8").replace("gazebo_models", "nobody")
    (tmp_path / "manifest.csv").write_text(manifest, "utf-8")
    with pytest.raises(BadInputError, match=r"red\.ply: CC-BY-3\.0, but the author of nobody"):
        notice(tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_parts_keep_their_order_and_get_other_lengths(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.uniform((0, 0, 0), (4.5, 1.8, 1.5), (200, 3))
    out = warped(vertices, ROAD_SIZES["car"], rng)
    for axis in range(3):
        assert (np.diff(out[np.argsort(vertices[:, axis]), axis]) >= 0).all()
    even, made = (part / np.ptp(part, axis=0) for part in (vertices, out))
    moved = np.ptp(made - even, axis=0)
    assert moved[0] > 1e-4
    assert moved[1] < 1e-9
    assert moved[2] > 1e-4


def test_a_warped_vehicle_stands_on_the_ground_in_the_middle():
    vertices = np.random.default_rng(0).uniform((-2, -1, 5), (3, 1, 7), (500, 3))
    out = warped(vertices, ROAD_SIZES["car"], np.random.default_rng(1))
    middle = (out.min(0) + out.max(0)) / 2
    np.testing.assert_allclose((*middle[:2], out[:, 2].min()), 0.0, atol=1e-9)
