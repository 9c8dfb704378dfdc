# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import re
from pathlib import Path

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.inference.point_inputs import as_points
from wildshape.io.scans.arrays import read_rows
from wildshape.io.scans.points import SUFFIXES, Coordinates, read_points, read_scan
from wildshape.io.scans.writers import write_ply

FORMATS = [
    "array.npy",
    "ascii.pcd",
    "ascii.ply",
    "binary.pcd",
    "binary_big_endian.ply",
    "binary_compressed.pcd",
    "binary_little_endian.ply",
    "format3.las",
    "format3.laz",
    "format6.las",
    "format6.laz",
    "header.csv",
    "kitti.bin",
    "named.npz",
    "only.npz",
    "plain.ply",
    "rows.xyz",
]


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_points(
    name: str, formats: dict[str, Path], cloud: np.ndarray
) -> None:
    scan = read_scan(formats[name])
    assert scan.points.dtype == np.float32
    assert scan.dropped_nonfinite == 0
    tolerance = 1e-6 if "format" in name else 0  # LAS keeps multiples of its scale
    np.testing.assert_allclose(scan.points, cloud, rtol=0, atol=tolerance)


@pytest.mark.parametrize("name", FORMATS)
def test_a_full_turn_of_a_sensor_is_read_as_points_and_refused_as_an_object(
    name: str, full_formats: dict[str, Path], full_scan: np.ndarray
) -> None:
    points = read_points(full_formats[name])
    np.testing.assert_allclose(points, full_scan, rtol=0, atol=1e-4 if "format" in name else 1e-5)
    refused(read_scan, full_formats[name], match="a whole scene .*`wildshape drive`")


def test_bare_numbers_of_another_row_are_no_kitti_scan(tmp_path: Path, cloud: np.ndarray) -> None:
    five = np.hstack([cloud, np.ones((len(cloud), 2), np.float32)])[: len(cloud) // 4 * 4]
    five = np.vstack([five, np.full((4, 5), np.nan, np.float32)])  # nothing came back
    five.tofile(tmp_path / "scan.pcd.bin")  # nuScenes
    np.testing.assert_array_equal(read_points(tmp_path / "scan.pcd.bin"), five[:-4, :3])
    five.tofile(tmp_path / "scan.bin")
    four = five[: len(five) // 5 * 5, :4]
    four.tofile(tmp_path / "four.pcd.bin")
    # As commands read a scan, and as the readers of data sets do.
    for read in (read_points, lambda path: read_rows(path, "x y z intensity")):
        refused(read, tmp_path / "scan.bin", match="are no intensities")
    for read in (read_points, lambda path: read_rows(path, "x y z intensity ring")):
        refused(read, tmp_path / "four.pcd.bin", match="are no intensities")


def test_a_full_scan_of_a_map_is_brought_to_its_sensor(tmp_path: Path, full_scan) -> None:
    np.save(tmp_path / "mm.npy", 1000 * (full_scan + np.array((4e5, 5e6, 30.0))))
    place = Coordinates("mm", (4e8, 5e9, 3e4))
    np.testing.assert_allclose(
        read_points(tmp_path / "mm.npy", place), full_scan, rtol=0, atol=1e-5
    )
    refused(read_points, tmp_path / "mm.npy", Coordinates("mm"), match="--origin")


def test_every_suffix_is_covered() -> None:
    assert {Path(name).suffix for name in FORMATS} | {".txt"} == set(SUFFIXES)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001)])
def test_units(unit, factor: float, tmp_path: Path, cloud: np.ndarray) -> None:
    np.save(tmp_path / "scan.npy", cloud.astype(np.float64) / factor)
    np.testing.assert_allclose(
        read_points(tmp_path / "scan.npy", Coordinates(unit)), cloud, rtol=1e-6
    )


def test_nonfinite_points_are_dropped_and_counted(tmp_path: Path, cloud: np.ndarray) -> None:
    dirty = cloud.copy()
    dirty[3, 1], dirty[10, 0], dirty[11, 2] = np.nan, np.inf, -np.inf
    for name in ("a.ply", "a.npy", "a.xyz"):
        path = tmp_path / name
        if name == "a.ply":
            write_ply(path, dirty)
        elif name == "a.npy":
            np.save(path, dirty)
        else:
            np.savetxt(path, dirty)
        scan = read_scan(path)
        assert scan.dropped_nonfinite == 3
        np.testing.assert_array_equal(scan.points, np.delete(cloud, [3, 10, 11], axis=0))


def test_what_did_not_return_is_dropped_and_counted(tmp_path: Path, cloud: np.ndarray) -> None:
    """Drivers and depth images write the sensor's own place; it is told from a scan beside it."""
    np.save(tmp_path / "a.npy", np.insert(cloud, [0, 5, 5], 0.0, axis=0))
    scan = read_scan(tmp_path / "a.npy")
    assert scan.dropped_nonfinite == 3
    np.testing.assert_array_equal(scan.points, cloud)
    np.testing.assert_array_equal(as_points(np.insert(cloud, [0, 5, 5], 0.0, axis=0)), cloud)
    np.save(tmp_path / "none.npy", np.zeros((20, 3)))
    refused(read_scan, tmp_path / "none.npy", match="all 20 points are equal")


def test_ply_round_trip_keeps_every_bit(tmp_path: Path, cloud: np.ndarray) -> None:
    write_ply(tmp_path / "new" / "a.ply", cloud)
    np.testing.assert_array_equal(read_points(tmp_path / "new" / "a.ply"), cloud)
    header = (tmp_path / "new" / "a.ply").read_bytes().split(b"end_header\n")[0]
    assert b"format binary_little_endian 1.0\n" in header
    assert header.count(b"property float") == 3


def test_empty_ply_round_trip(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", np.empty((0, 3), np.float32))
    assert read_points(tmp_path / "a.ply").shape == (0, 3)


def test_files_of_other_programs_are_read(tmp_path: Path, cloud: np.ndarray) -> None:
    trimesh = pytest.importorskip("trimesh")
    faces = np.arange(60).reshape(-1, 3)
    trimesh.PointCloud(cloud).export(tmp_path / "cloud.ply")
    trimesh.Trimesh(cloud, faces, process=False).export(tmp_path / "mesh.ply")
    trimesh.Trimesh(cloud, faces, process=False).export(tmp_path / "text.ply", encoding="ascii")
    np.testing.assert_array_equal(read_points(tmp_path / "cloud.ply"), cloud)
    np.testing.assert_array_equal(read_points(tmp_path / "mesh.ply"), cloud)
    np.testing.assert_allclose(read_points(tmp_path / "text.ply"), cloud, atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3\n4 5 6",
        "# comment\n1, 2, 3, 99\n4, 5, 6, 99\n",
        "// comment\nx;y;z\n1;2;3\n\n4;5;6\n",
        "\ufeffintensity,z,y,x\n0,3,2,1\n0,6,5,4\n",
        "2\n1\t2\t3\r\n4\t5\t6\r\n",
        '"x" "y" "z"\n1 2 3\n4 5 6 7 8\n',
    ],
)
def test_text_variants(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(text.encode())
    np.testing.assert_array_equal(read_points(tmp_path / "a.txt"), [[1, 2, 3], [4, 5, 6]])


def test_records_and_extra_columns_of_npy(tmp_path: Path) -> None:
    records = np.array([(9, 1, 2, 3)], [("i", "u1"), ("x", "f4"), ("y", "f8"), ("z", "i2")])
    np.save(tmp_path / "a.npy", records)
    np.save(tmp_path / "b.npy", np.array([[1, 2, 3, 4]]))
    assert read_points(tmp_path / "a.npy").tolist() == [[1, 2, 3]]
    assert read_points(tmp_path / "b.npy").tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
def test_an_array_on_its_side_is_named_with_its_cure(name: str, tmp_path: Path, cloud) -> None:
    (np.save if name == "a.npy" else np.savez)(tmp_path / name, cloud.T)
    refused(read_points, tmp_path / name, match=r"is an array 3 x 60, .*its transpose, points\.T")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_of_no_bytes_is_called_empty(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").touch()
    refused(read_scan, tmp_path / f"a{suffix}", match=r"is empty \(0 bytes\)")


def test_a_header_without_points_is_called_so(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", np.empty((0, 3), np.float32))
    np.save(tmp_path / "a.npy", np.empty((0, 3)))
    np.savez(tmp_path / "a.npz", np.empty((0, 3)))
    (tmp_path / "a.csv").write_text("x,y,z\n")
    for path in tmp_path.iterdir():
        refused(read_scan, path, match="is empty but for its header")


def test_fortran_order_and_records_of_archives(tmp_path: Path, cloud: np.ndarray) -> None:
    np.savez(tmp_path / "a.npz", np.asfortranarray(cloud))
    records = np.array([(9, 1, 2, 3)] * 20, [("i", "u1"), ("x", ">f4"), ("y", "f8"), ("z", "i2")])
    np.savez_compressed(tmp_path / "b.npz", records)
    np.testing.assert_array_equal(read_points(tmp_path / "a.npz"), cloud)
    assert read_points(tmp_path / "b.npz").tolist() == [[1, 2, 3]] * 20


def test_unknown_suffix_lists_the_known(tmp_path: Path) -> None:
    refused(read_points, tmp_path / "a.stl", match=re.escape(" ".join(SUFFIXES)))


def test_missing_file_and_folder(tmp_path: Path) -> None:
    refused(read_points, tmp_path / "a.ply", match=r"a\.ply: no such file")
    (tmp_path / "b.ply").mkdir()
    refused(read_points, tmp_path / "b.ply", match=r"b\.ply: cannot be read")
