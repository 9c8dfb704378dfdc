# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Results turn into objects of other libraries, and come back as scans."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

import wildshape
from wildshape.geometry.se3 import SE3
from wildshape.inference.prepare import as_points
from wildshape.records import Box, Completion, Registration, Track


@pytest.fixture
def done():
    """Points far from the sensor, on no round numbers."""
    points = np.random.default_rng(0).normal(size=(40, 3)) + np.array((61.7, -48.3, -1.9))
    pose = SE3.from_matrix(np.diag((-1.0, -1.0, 1.0, 1.0)))
    box = Box((0.0, 0.0, 0.0), (4.0, 2.0, 1.5), (1.0, 0.0, 0.0, 0.0))
    return Completion(points.astype(np.float32), pose, box, confidence=0.9, branch=0, cost=0.1)


def test_arrays_and_tensors(done):
    np.testing.assert_array_equal(np.asarray(done), done.points)
    assert np.asarray(done, np.float64).dtype == np.float64
    tensor = done.to_torch()
    assert tensor.dtype == torch.float32
    tensor[:] = 0
    assert np.asarray(done).any(), "the tensor is no copy"


def test_clouds_of_other_libraries_are_scans_again(done):
    np.testing.assert_allclose(done.to_trimesh().vertices, done.points)
    np.testing.assert_allclose(as_points(done.to_trimesh()), done.points)
    np.testing.assert_allclose(as_points(done.to_laspy()), done.points, atol=1e-4)


def test_open3d_is_given_its_points(done, monkeypatch):
    """With a stand-in: it is no dependency."""
    stand_in = ModuleType("open3d")
    stand_in.utility = SimpleNamespace(Vector3dVector=np.array)  # pyright: ignore[reportAttributeAccessIssue]
    stand_in.geometry = SimpleNamespace(PointCloud=lambda p: SimpleNamespace(points=p))  # pyright: ignore[reportAttributeAccessIssue]
    monkeypatch.setitem(sys.modules, "open3d", stand_in)
    cloud = done.to_open3d()
    assert cloud.points.dtype == np.float64
    np.testing.assert_array_equal(as_points(cloud), done.points)


def test_open3d_itself(done):
    pytest.importorskip("open3d", reason="did not run: Open3D is not installed (extra open3d)")
    np.testing.assert_array_equal(as_points(done.to_open3d()), done.points)


def test_without_open3d_one_sentence_says_how_to_get_it(done, monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(wildshape.MissingExtraError, match=r"pip install 'wildshape\[open3d\]'"):
        done.to_open3d()


def test_registration_is_a_matrix():
    expected = np.array([[0, -1, 0, 3], [1, 0, 0, -2], [0, 0, 1, 0.5], [0, 0, 0, 1.0]])
    found = Registration(SE3.from_matrix(expected), inlier_ratio=1.0, confidence=0.9)
    np.testing.assert_array_equal(found.matrix, expected)
    np.testing.assert_array_equal(np.asarray(found), expected)
    assert np.asarray(found, np.float32).dtype == np.float32


def test_every_public_name_is_there():
    for name in wildshape.__all__:
        assert getattr(wildshape, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'lode'"):
        _ = wildshape.lode


@pytest.mark.parametrize("posed", [True, False])
def test_part_of_a_track_keeps_scans_names_and_poses_together(posed):
    shifts = torch.arange(15.0, dtype=torch.float64).reshape(5, 3)
    poses = SE3(torch.eye(3, dtype=torch.float64).expand(5, 3, 3), shifts) if posed else None
    scans = tuple(np.full((3, 3), i, np.float32) for i in range(5))
    part = Track("a", scans, tuple("vwxyz"), category="car", T_sensor_object=poses).part([4, 0, 2])
    assert [int(scan[0, 0]) for scan in part.scans] == [4, 0, 2]
    assert part.scan_names == ("z", "v", "x")
    assert (part.name, part.category) == ("a", "car")
    assert (part.T_sensor_object is not None) == posed
    if part.T_sensor_object is not None:
        torch.testing.assert_close(part.T_sensor_object.translation, shifts[[4, 0, 2]])
