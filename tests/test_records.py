# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Results turn into objects of other libraries, and come back as scans."""

import copy
import math
import re
import subprocess
import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

import wildshape
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.point_inputs import as_points
from wildshape.records import Box, Completion, Intrinsics, Registration, Sensor, Track


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


def test_what_holds_arrays_is_equal_to_itself_alone(done):
    """`==` raised that the truth of an array is ambiguous, and so did `in`."""
    track = Track("car", (done.points,), ("0",))
    found = Registration(done.pose, 1.0, 0.9)
    rays = SightLines.of_returns(done.points[:3])
    for one in (done, done.pose, track, found, rays):
        other = copy.deepcopy(one)
        assert one == one
        assert one != other
        assert other in [one, other]
        assert len({one, other}) == 2
    assert copy.deepcopy(done).box == done.box


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


def test_public_names_show_before_anything_heavy_is_imported():
    program = (
        "import sys, wildshape, io, contextlib\n"
        "assert not {'torch', 'numpy'} & set(sys.modules)\n"
        "assert set(wildshape.__all__) <= set(dir(wildshape))\n"
        "assert not {'torch', 'numpy'} & set(sys.modules)\n"
        "print(__import__('pydoc').render_doc(wildshape, renderer=__import__('pydoc').plaintext))\n"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    for heading in ("class Completion(", "class Predictor(", "    load(", "    save("):
        assert heading in found.stdout, heading


# Turned a quarter about z (x to y), then tipped forward by 30 degrees about its own y.
TURNED = (math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4))
TIPPED = (
    math.cos(math.pi / 4) * math.cos(math.pi / 12),
    -math.sin(math.pi / 4) * math.sin(math.pi / 12),
    math.cos(math.pi / 4) * math.sin(math.pi / 12),
    math.sin(math.pi / 4) * math.cos(math.pi / 12),
)


def test_a_sensor_of_another_kind_is_refused():
    program = "import wildshape; wildshape.Sensor('LiDAR')"  # where no test checks types
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "BadInputError: sensor 'LiDAR' is unknown; use 'lidar' or 'camera'." in found.stderr


def test_corners_of_a_box_are_in_the_order_that_is_documented():
    corners = Box((10.0, 5.0, 1.0), (4.0, 2.0, 1.5), TURNED).corners
    rear_right_bottom, front_left_top = (11.0, 3.0, 0.25), (9.0, 7.0, 1.75)
    np.testing.assert_allclose(corners[[0, 7]], (rear_right_bottom, front_left_top), atol=1e-12)
    np.testing.assert_allclose(corners[4] - corners[0], (0.0, 4.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(corners[2] - corners[0], (-2.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(corners[1] - corners[0], (0.0, 0.0, 1.5), atol=1e-12)


@pytest.mark.parametrize("wxyz", [TURNED, TIPPED, tuple(-part for part in TURNED)])
def test_yaw_of_a_box_is_where_its_x_axis_points_seen_from_above(wxyz):
    box = Box((10.0, 5.0, 1.0), (4.0, 2.0, 1.5), wxyz)
    assert box.yaw == pytest.approx(math.pi / 2)
    flat = Box(box.centre, (0.0, 0.0, 0.0), wxyz)
    assert flat.yaw == pytest.approx(box.yaw), "the heading does not depend on the size"


def test_records_say_in_a_line_what_they_hold(done):
    track = Track("a", (done.points,) * 3, tuple("xyz"), category="car", shape=done.points)
    found = Registration(done.pose, inlier_ratio=0.75, confidence=0.9, warning="too large.")
    said = {
        "Box(4.00 x 2.00 x 1.50 m, centre (0.00, 0.00, 0.00), yaw 0.0 degrees)": done.box,
        "SE3(moves by (0.00, 1.00, 0.00) m, turns by 0.0 degrees)": SE3(
            torch.eye(3), torch.tensor((-0.001, 1.0, -0.0))
        ),
        f"Completion(40 points, confidence 0.90, {done.box!r})": done,
        "Track('a', 3 scans of 40 to 40 points, car, true shape)": track,
        "Track('b', 0 scans of 0 to 0 points, lidar)": Track("b", (), ()),
        "SE3(moves by (0.00, 0.00, 0.00) m, turns by 180.0 degrees)": done.pose,
        "SE3(5 x 2 transforms)": SE3.identity(5, 2),
        "Sensor(lidar)": Sensor(),
        "Sensor(lidar, 0.1 x 0.4 degrees)": Sensor("lidar", (0.1, 0.4)),
        "Sensor(camera, 4 x 3 pixels)": Sensor(
            "camera", None, Intrinsics(1.0, 1.0, 2.0, 2.0, 4, 3)
        ),
    }
    for text, record in said.items():
        assert repr(record) == text
    doubtful = replace(done, reasons=("unsure", "flat"))
    assert repr(doubtful) == repr(done)[:-1] + ", not to be trusted: unsure, flat)"
    assert repr(found) == (
        f"Registration({done.pose!r}, inlier ratio 0.75, confidence 0.90, warning: too large.)"
    )
    model = wildshape.load("chair")
    assert re.fullmatch(
        r"Predictor\(camera, objects of [\d.]+ to [\d.]+ m, [\d.]+ million weights, on cpu\)",
        repr(model),
    )


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
