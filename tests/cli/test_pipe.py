# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`-` is stdin and stdout: shapes go through pipes, and what cannot is refused in one sentence."""

import io
import json
import subprocess
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

from wildshape.cli.main import main
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import ply_bytes
from wildshape.report.results import TrackResult


@pytest.fixture
def scan_file(dataset):
    return sorted((dataset / "000001" / "scans").iterdir())[2]


@pytest.fixture
def feed(monkeypatch):
    """Put bytes on stdin."""

    def put(data, terminal=False):
        held = SimpleNamespace(buffer=io.BytesIO(data), isatty=lambda: terminal)
        monkeypatch.setattr(sys, "stdin", held)

    return put


@pytest.fixture
def pipe(feed, capsysbinary, trained):
    """Run a command with a scan on stdin; what it wrote to stdout."""

    def run(data, *arguments):
        feed(data)
        main([str(argument) for argument in (*arguments, "--model", trained)])
        return capsysbinary.readouterr().out

    return run


def test_a_shape_goes_through_a_pipe(scan_file, dataset, trained, tmp_path):
    """As users type it, in a shell of its own."""
    shape = tmp_path / "shape.ply"
    command = [sys.executable, "-m", "wildshape.cli", "complete", "-", "--out", "-"]
    with scan_file.open("rb") as given, shape.open("wb") as made:
        subprocess.run([*command, "--model", str(trained)], stdin=given, stdout=made, check=True)
    main(["complete", str(scan_file), "--out", str(tmp_path / "c"), "--model", str(trained)])
    (expected,) = tmp_path.glob("c/*/completed/*.ply")
    np.testing.assert_allclose(read_points(shape), read_points(expected), atol=1e-5)


def test_every_way_to_the_same_shape(pipe, scan_file, tmp_path):
    points = read_points(scan_file)
    text = "\n".join(" ".join(f"{x:.9g}" for x in row) for row in points).encode()
    found = {
        "ply": pipe(scan_file.read_bytes(), "complete", "-"),
        "text": pipe(text, "complete", "-", "--out", "-"),
        "file": pipe(b"", "complete", scan_file, "--out", "-"),
        "millimetres": pipe(ply_bytes(points * 1000), "complete", "-", "--unit", "mm"),
        "kitti": pipe(kitti(points), "complete", "-", "--format", "bin"),
    }
    shapes = {}
    for name, data in found.items():
        (tmp_path / f"{name}.ply").write_bytes(data)
        shapes[name] = read_points(tmp_path / f"{name}.ply")
    for name, shape in shapes.items():
        np.testing.assert_allclose(shape, shapes["ply"], atol=1e-3, err_msg=name)
    said = json.loads(pipe(text, "complete", "-", "--json"))
    np.testing.assert_allclose(said["points"], shapes["ply"], atol=1e-3)
    assert said["scan"] == "stdin"
    assert np.shape(said["T_sensor_canonical"]) == (4, 4)
    assert {"box", "confidence", "warning"} <= set(said)


def test_shapes_are_written_as_pcd_too(pipe, scan_file, tmp_path):
    order = ("complete", scan_file, "--out")
    for kind in ("ply", "pcd"):
        pipe(b"", *order, tmp_path / kind, "--cloud-format", kind)
    (ply,), (pcd,) = (tmp_path.glob(f"{kind}/*/completed/*.*") for kind in ("ply", "pcd"))
    assert (ply.suffix, pcd.suffix, pcd.stem) == (".ply", ".pcd", ply.stem)
    np.testing.assert_array_equal(read_points(pcd), read_points(ply))
    found = TrackResult(pcd.parents[1], {}, None)
    assert found.completed_scans() == [pcd.stem]
    np.testing.assert_array_equal(found.completed(pcd.stem), read_points(ply))
    assert pipe(b"", *order, "-", "--cloud-format", "pcd") == pcd.read_bytes()


def kitti(points):
    return np.column_stack((points, np.zeros(len(points)))).astype("<f4").tobytes()


@pytest.mark.parametrize("given", [("--workers", 3), ("--ray", "local"), ("--overwrite",)])
def test_options_of_a_folder_are_refused_where_none_is_written(refused, scan_file, given):
    for order in (("complete", scan_file, "--out", "-"), ("register", scan_file, scan_file)):
        assert "writes no folder" in refused(*order, *given)


@pytest.mark.parametrize("kind", ["ply", "glb"])
def test_a_coloured_mesh_goes_through_a_pipe(kind, pipe, scan_file, tmp_path):
    order = ("--mesh", "--mesh-format", kind, "--mesh-colours", "confidence")
    path = tmp_path / f"mesh.{kind}"
    path.write_bytes(pipe(scan_file.read_bytes(), "complete", "-", *order))
    found: Any = trimesh.load_mesh(path)
    assert found.is_watertight
    assert np.ptp(np.asarray(found.visual.vertex_colors)[:, 0].astype(int)) > 30


def test_register_takes_a_pipe_for_either_scan(pipe, dataset):
    a, b = sorted((dataset / "000000" / "scans").iterdir())[:2]
    expected = json.loads(pipe(b"", "register", a, b, "--json"))
    first = json.loads(pipe(a.read_bytes(), "register", "-", b, "--json"))
    second = json.loads(pipe(b.read_bytes(), "register", a, "-", "--json"))
    assert first == second == expected


def test_a_mesh_is_no_json(refused, scan_file):
    said = refused("complete", scan_file, "--out", "-", "--mesh", "--json")
    assert "--mesh: with --json stdout holds points" in said


@pytest.mark.parametrize("other", ["--mesh", "--json"])
def test_a_mesh_or_json_is_no_cloud(refused, scan_file, other):
    said = refused("complete", scan_file, "--out", "-", other, "--cloud-format", "pcd")
    assert "--cloud-format: with --mesh or --json" in said


def test_meshes_of_a_folder_are_coloured(wildshape, scan_file, trained, tmp_path):
    order = ("complete", scan_file, "--out", tmp_path / "c", "--model", trained, "--mesh")
    assert wildshape(*order, "--mesh-colours", "confidence", "--mesh-format", "obj").code == 0
    (mesh,) = tmp_path.glob("c/*/mesh/*.obj")
    vertex = next(line for line in mesh.read_text().splitlines() if line.startswith("v "))
    assert len(vertex.split()) == 7


@pytest.mark.parametrize(
    ("data", "arguments", "said"),
    [
        (b"", ("complete", "-"), "stdin: is empty"),
        (b"\x01\x02" * 90, ("complete", "-"), "--format bin"),
        (b"1 2 3\n" * 3, ("complete", "-"), "stdin: 3 finite points"),
        (b"ply\nformat ascii 1.0\n", ("complete", "-"), "stdin: "),
        (b"1 2 3\n" * 30, ("complete", "-", "--format", "ply"), "stdin: expected a PLY file"),
        (b"1 2 3\n", ("complete", "-", "--out", "folder"), "leave --out away"),
        (b"", ("complete", "scan.ply"), "--out DIR"),
        (b"", ("complete", "scan.ply", "--out", "-"), "no such file"),
        (b"", ("complete", "a.ply", "--out", "-", "--format", "ply"), "--format is for stdin"),
        (b"", ("complete", "a.ply", "--out", "c", "--format", "ply"), "is for a scan on stdin"),
        (b"", ("complete", "-", "--mesh-colours", "confidence"), "pass --mesh"),
        (b"", ("complete", "a.ply", "--out", "c", "--mesh-format", "glb"), "pass --mesh"),
        (b"", ("drive", "a", "--out", "c", "--mesh-format", "obj"), "pass --mesh"),
        (b"", ("register", "-", "-"), "stdin holds one scan"),
        (b"", ("register", "a.ply", "b.ply", "--format", "ply"), "is for a scan on stdin"),
    ],
)
def test_what_cannot_be_piped_is_refused(data, arguments, said, feed, refused, tmp_path):
    feed(data)
    sentence = refused(*arguments)
    assert said in sentence
    assert str(tmp_path.parent) not in sentence
    assert "wildshape." not in sentence.split(": ", 1)[1], "names the file that stdin was kept in"


def test_a_track_is_no_single_shape(refused, dataset):
    assert "6 scans" in refused("complete", dataset / "000000", "--out", "-")
    assert "6 tracks" in refused("complete", dataset, "--out", "-")


def test_terminals_are_neither_read_nor_garbled(feed, refused, scan_file, monkeypatch):
    feed(b"", terminal=True)
    assert "stdin is a terminal" in refused("complete", "-")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert "stdout is a terminal" in refused("complete", scan_file, "--out", "-")
