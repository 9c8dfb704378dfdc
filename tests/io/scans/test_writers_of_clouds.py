# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points come back from every format, wherever they lie."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.io.scans.points import Coordinates, read_points
from wildshape.io.scans.writers import CLOUD_SUFFIXES, save, write_cloud

OFFSET = np.array((83.1, -61.9, -2.2))
POINTS = (np.random.default_rng(0).normal(size=(50, 3)) + OFFSET).astype(np.float32)


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_saved_points_read_back(suffix, tmp_path):
    path = tmp_path / "new" / f"shape{suffix}"
    save(POINTS, path)
    np.testing.assert_allclose(read_points(path), POINTS, atol=1e-4)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_pcd_is_binary_and_other_programs_read_it(tmp_path):
    from pypcd4.pypcd4 import PointCloud

    save(POINTS, tmp_path / "a.pcd")
    write_cloud(tmp_path / "none.pcd", POINTS[:0])
    head = (tmp_path / "a.pcd").read_bytes()
    assert b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n" in head
    assert b"DATA binary\n" in head
    np.testing.assert_array_equal(PointCloud.from_path(tmp_path / "a.pcd").numpy(), POINTS)
    np.testing.assert_array_equal(read_points(tmp_path / "a.pcd"), POINTS)
    assert read_points(tmp_path / "none.pcd").shape == (0, 3)


def test_whatever_is_an_array_is_saved(tmp_path):
    held = SimpleNamespace(__array__=None)
    tensor = torch.from_numpy(POINTS)
    shapes = {"list": POINTS.tolist(), "tensor": tensor, "graded": tensor.clone().requires_grad_()}
    for name, shape in shapes.items():
        save(shape, str(tmp_path / f"{name}.npy"))
        np.testing.assert_array_equal(np.load(tmp_path / f"{name}.npy"), POINTS)
    for wrong in (POINTS[:, :2], POINTS[0], "words", held):
        refused(save, wrong, tmp_path / "x.ply", match=r"x\.ply: cannot save")


MAP = np.array((691_234.5678, 5_334_567.8912, 519.1234))  # UTM, metres


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_points_of_a_map_keep_their_millimetres_or_are_refused(suffix, tmp_path):
    path, far = tmp_path / f"map{suffix}", POINTS.astype(np.float64) + MAP
    if suffix in (".ply", ".pcd"):
        refused(save, far, path, match=r"map\.p.*float32, .* up to \d+ cm; subtract")
        assert not path.exists()
        save(POINTS.astype(np.float64) / 3, path)
        np.testing.assert_allclose(read_points(path), POINTS / 3, atol=1e-5)
    else:
        save(far, path)
        origin = Coordinates(origin=(MAP[0], MAP[1], MAP[2]))
        np.testing.assert_allclose(read_points(path, origin), POINTS, atol=2e-4)


def test_what_are_no_points_is_refused(tmp_path):
    holed, endless = POINTS.copy(), POINTS.copy()
    holed[3, 1], endless[0, 0] = np.nan, np.inf
    hidden = np.ma.masked_less(POINTS, 0)
    for wrong in (POINTS.astype(complex), POINTS[:0], np.zeros((0, 3)), holed, endless, hidden):
        refused(save, wrong, tmp_path / "x.npy", match=r"x\.npy: cannot save")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_a_cloud_wider_than_las_reaches_is_refused(suffix, tmp_path):
    with pytest.raises(BadInputError, match=r"wide\.la.: .* 214 km .* write \.npy"):
        save(np.array([[0.0, 0, 0], [215e3, 0, 0]]), tmp_path / f"wide{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_another_suffix_is_refused_and_leaves_nothing(tmp_path):
    for name in ("shape.stl", "shape"):
        refused(save, POINTS, tmp_path / name, match=r"\.ply \.pcd \.npy")
    assert list(tmp_path.iterdir()) == []
