# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from types import SimpleNamespace

import laspy
import numpy as np
import pytest
import torch
import trimesh

from wildshape.errors import BadInputError
from wildshape.inference.point_inputs import as_points, as_rays, each_of, rays_of_each
from wildshape.io.scans.points import read_scan

RNG = np.random.default_rng(0)


def scan(count=50):
    return RNG.normal(size=(count, 3)).astype(np.float32) + np.array([8, 1, -1], np.float32)


def test_points_that_are_not_finite_are_dropped():
    points = scan()
    points[[3, 7], [0, 2]] = np.nan, np.inf
    found = as_points(points)
    np.testing.assert_array_equal(found, np.delete(points, [3, 7], axis=0))


@pytest.mark.parametrize(
    "given",
    [
        lambda p: p.astype(np.float64),
        np.ndarray.tolist,
        torch.tensor,
        lambda p: torch.tensor(p).requires_grad_(),
        np.asfortranarray,
    ],
)
def test_arrays_lists_and_tensors(given):
    points = scan()
    found = as_points(given(points))
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, points)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros((0, 3)), "0 finite points; at least 16"),
        (1 + np.eye(15)[:, :3], "15 finite points"),
        (np.full((40, 3), np.nan), "0 finite points"),
        (np.ones((40, 3)), "all 40 points are equal"),
        (
            np.vstack((1 + np.eye(20)[:, :3], np.full((1, 3), 3e38))),
            "across, but a scan of one object",
        ),
        (np.zeros((40, 4)), r"shape \(n, 3\), found \(40, 4\)"),
        (np.zeros(40), r"found \(40,\)"),
        ([[1.0, 2.0, 3.0], [1.0]], "no array of numbers"),
        (np.eye(40)[:, :3] * 1j, "its numbers are complex"),
        (None, "shape"),
        (torch.ones(40, 3, device="meta"), "no array of numbers"),
    ],
)
def test_what_is_no_scan_is_refused(given, said):
    with pytest.raises(BadInputError, match=said) as refused:
        as_points(given, "scan 7")
    assert str(refused.value).startswith("scan 7: ")


def test_points_of_other_libraries_and_paths(tmp_path):
    """laspy, trimesh, Open3D's two clouds (stand-ins: it is no dependency), files."""
    points = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
    np.save(tmp_path / "scan.npy", points)
    las = laspy.create()
    las.header.scales = np.full(3, 1e-6)
    las.x, las.y, las.z = points.T.astype(np.float64)
    tensor = torch.from_numpy(points)
    given = {
        "path": tmp_path / "scan.npy",
        "text": str(tmp_path / "scan.npy"),
        "laspy": las,
        "trimesh": trimesh.PointCloud(points),
        "open3d": SimpleNamespace(points=points.astype(np.float64).tolist()),
        "open3d tensors": SimpleNamespace(point=SimpleNamespace(positions=tensor)),
    }
    for name, scan in given.items():
        np.testing.assert_allclose(as_points(scan), points, atol=1e-6, err_msg=name)
    with pytest.raises(BadInputError, match=r"nowhere\.ply"):
        as_points(tmp_path / "nowhere.ply")


def test_masked_rows_are_dropped():
    points = np.ma.masked_array(scan(), mask=False)
    points[[2, 5]] = np.ma.masked
    points.data[[2, 5]] = 40.0
    np.testing.assert_array_equal(as_points(points), np.delete(points.data, [2, 5], axis=0))


@pytest.mark.parametrize("order", ["xyz", "zyx"])
def test_records_are_read_by_the_names_of_their_fields(order):
    """As `sensor_msgs_py` hands out a message of ROS."""
    points = scan()
    rows = np.zeros(len(points), [("intensity", "f4"), *((axis, "<f8") for axis in order)])
    for axis, values in zip("xyz", points.T):
        rows[axis] = values
    np.testing.assert_array_equal(as_points(rows), points)
    with pytest.raises(BadInputError, match="no array of numbers"):
        as_points(rows[["x", "y"]])


def test_rays_may_be_learned_of_and_have_one_range_each():
    directions, ranges = torch.eye(3).requires_grad_(), torch.ones(3).requires_grad_()
    found = as_rays((directions, ranges))
    assert found is not None
    assert found.ranges.tolist() == [1.0] * 3
    with pytest.raises(BadInputError, match=r"ranges \(3, 1\)"):
        as_rays((np.eye(3), np.ones((3, 1))))


@pytest.mark.parametrize("which", [0, 1, 2])
def test_masked_and_complex_rays_are_refused(which):
    """numpy drops a mask, and imaginary parts, without a word."""
    rays = [np.eye(3), np.ones(3), np.zeros((3, 3))]
    assert len(as_rays(tuple(np.ma.masked_array(part) for part in rays)) or ()) == 3
    for wrong, said in (
        (np.ma.masked_less(rays[which], 2), "masked in part"),
        (rays[which] * 1j, "no array of numbers"),
    ):
        with pytest.raises(BadInputError, match=f"^rays 7: .*{said}"):
            as_rays([*rays[:which], wrong, *rays[which + 1 :]], "rays 7")


def test_what_may_not_be_written_is_copied():
    """Of such an array torch warns, and warnings may be errors."""
    points = scan()
    assert as_points(points) is points
    points.setflags(write=False)
    assert as_points(points).flags.writeable


def test_a_place_counts_once_however_often_it_is_repeated(tmp_path):
    points = scan()
    often = np.concatenate([points[:30], points, points[::-1]])
    np.testing.assert_array_equal(as_points(often), points)
    np.save(tmp_path / "scan.npy", often)
    np.testing.assert_array_equal(read_scan(tmp_path / "scan.npy").points, points)
    few = np.repeat(points[:3], 8, axis=0)
    np.save(tmp_path / "few.npy", few)
    for given in (few, tmp_path / "few.npy"):
        with pytest.raises(BadInputError, match="24 points in 3 places"):
            as_points(given)


def test_scans_may_be_handed_in_one_after_the_other():
    scans = [scan(), scan()]
    assert [one is other for one, other in zip(each_of(one for one in scans), scans)] == [True] * 2
    for wrong in ({"a": scans[0]}, "scan.ply", 3, {"b.ply", "a.ply"}):
        with pytest.raises(BadInputError, match="expected a list of scans"):
            each_of(wrong)


@pytest.mark.parametrize("given", [scan(), torch.from_numpy(scan())])
def test_one_scan_alone_is_no_list_of_its_points(given):
    with pytest.raises(BadInputError, match="found one array; put it in a list"):
        each_of(given)


@pytest.mark.parametrize("given", ["rays.npz", {"directions": np.eye(3), "ranges": np.ones(3)}])
def test_what_is_no_list_of_rays_is_not_called_scans(given):
    with pytest.raises(BadInputError, match="expected a list of sets of rays"):
        rays_of_each(given, [scan()])
