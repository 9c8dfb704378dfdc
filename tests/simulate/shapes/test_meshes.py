# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes of every format are the surface that trimesh reads, and cost what their files hold."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from tests.io.limits import read_within_limits
from tests.refusal import refused

from wildshape.simulate.shapes.meshes import read_mesh
from wildshape.simulate.shapes.solid import Solid

_BOX = trimesh.creation.box((4.0, 1.8, 1.4))
_CORNERS = "0 0 0\n4 0 0\n4 2 0\n0 2 0\n"
_PLY = (
    "ply\nformat {} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
)
_FACES = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"


def _triangles(solid: Solid) -> np.ndarray:
    return solid.vertices[solid.faces]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("car.obj", {}),
        ("car.off", {}),
        ("car.stl", {}),
        ("car.stl", {"file_type": "stl_ascii"}),
        ("car.ply", {}),
        ("car.ply", {"encoding": "ascii"}),
        ("car.PLY", {"file_type": "ply"}),
        ("car.glb", {}),
    ],
)
def test_a_mesh_is_the_surface_that_trimesh_reads(
    name: str, options: dict[str, Any], tmp_path: Path
) -> None:
    _BOX.export(tmp_path / name, **options)
    expected: Any = trimesh.load(tmp_path / name, force="mesh", process=False)
    found = _triangles(read_mesh(tmp_path / name, metres=True))
    axes = (2, 0, 1) if name.endswith(".glb") else (0, 1, 2)  # glTF: y up, z forward
    np.testing.assert_allclose(found, expected.triangles[..., axes], atol=1e-6)


_VERTICES = "".join(f"v {line}\n" for line in _CORNERS.splitlines())
_QUAD = {
    "obj": f"# a quad\n{_VERTICES}l 1 2\nf 1/1/1 2/2 \\\n3//4 -1\n",
    "off": f"OFF4 1 0 # faces\n{_CORNERS}\n4 0 1 2 3 255 0 0\n",
    "ply": _PLY.format("ascii") + _FACES.format(1) + _CORNERS + "4 0 1 2 3\n",
}


@pytest.mark.parametrize("kind", _QUAD)
def test_a_polygon_is_a_fan_of_triangles(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"quad.{kind}"
    path.write_text(_QUAD[kind])
    corners = np.array([[0, 0], [4, 0], [4, 2], [0, 2]]) - (2, 1)
    found = _triangles(read_mesh(path, metres=True))
    np.testing.assert_allclose(found[..., :2], corners[[[0, 1, 2], [0, 2, 3]]])


def test_quads_of_a_binary_ply(tmp_path: Path) -> None:
    points = np.array(_CORNERS.split(), ">f4").tobytes()
    quad = b"\4" + np.arange(4, dtype=">i4").tobytes()
    path = tmp_path / "quads.ply"
    head = _PLY.format("binary_big_endian") + _FACES.format(2)
    path.write_bytes(head.encode() + points + quad + quad)
    assert read_mesh(path, metres=True).faces.tolist() == [[0, 1, 2], [0, 2, 3]] * 2
    mixed = b"\3" + np.arange(3, dtype=">i4").tobytes()
    path.write_bytes(head.encode() + points + quad + mixed)
    refused(read_mesh, path, metres=True, match=r"quads\.ply.*differ in their corners")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "none of its 1 vertices"),
        ("a.obj", "v 0 0 0\nf 0 1 1\n", "none of its 1 vertices"),
        ("a.obj", "v 0 0 0\n", "no triangles"),
        ("a.off", f"OFF\n4 2 0\n{_CORNERS}3 0 1 2\n", "2 lines are promised, 1 are there"),
        ("a.off", f"OFF\n4 1 0\n{_CORNERS}4 0 1 2\n", "a face of 4 corners in a line of 3"),
        ("a.off", "4 1 0\n", "no OFF"),
        ("a.stl", "x" * 200, "in a file of another length"),
        ("a.ply", _PLY.format("ascii") + "end_header\n" + _CORNERS, "element 'face'"),
        ("a.ply", _PLY.format("ascii") + _FACES.format(9) + _CORNERS, "promises 9"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(
    name: str, text: str, message: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    refused(read_mesh, tmp_path / name, metres=True, match=rf"{name[0]}\{name[1:]}.*{message}")


def _crafted(folder: Path, count: int = 120_000) -> None:
    """Short lines, which cost most for what they take in a file; headers that lie."""

    def write(name: str, *parts: str) -> None:
        (folder / name).write_text("".join(parts))

    write("whole.obj", "v 0 0 0\nv 4 0 0\n" * (count // 2), "f 1 2 3\n" * count)
    write(
        "whole.off",
        f"OFF\n{count} {count} 0\n",
        "0 0 0\n4 0 0\n" * (count // 2),
        "3 0 1 2\n" * count,
    )
    write("whole.stl", "solid\n", "vertex 0 0 0\nvertex 4 0 0\n" * (count // 2))
    ply = _PLY.format("ascii").replace("vertex 4", f"vertex {count}") + _FACES.format(count)
    write("whole.ply", ply, "0 0 0\n4 0 0\n" * (count // 2), "3 0 1 2\n" * count)
    write("polygon.obj", "v 0 0 0\nv 4 0 0\n", "f", " 1 2" * 200_000, "\n")
    write("polygon_lines.obj", "v 0 0 0\nv 4 0 0\n", "f", " 1 2 \\\n" * 100_000, "\n")
    write("endless.obj", "f \\\n", "1 1 1 1 1 1 1 1 \\\n" * 300_000)
    write("lie.off", "OFF\n9000000000 1 0\n0 0 0\n")
    write("lie.ply", _PLY.format("ascii") + _FACES.format(60_000_000) + _CORNERS)
    write(
        "empty_faces.ply",
        _PLY.format("ascii") + _FACES.format(2_000_000) + _CORNERS,
        "0\n" * 2_000_000,
    )
    (folder / "lie.stl").write_bytes(bytes(80) + b"\xff" * 54)
    binary = "binary_little_endian"
    (folder / "empty_binary.ply").write_bytes(
        (_PLY.format(binary) + _FACES.format(2_000_000)).encode() + bytes(2_000_048)
    )


def read(path: Path) -> range:
    """As many as there are points and triangles."""
    solid = read_mesh(path, metres=False)
    return range(len(solid.vertices) + len(solid.faces))


def test_no_mesh_costs_more_than_its_file_holds(tmp_path: Path) -> None:
    _crafted(tmp_path)
    files = sorted(tmp_path.iterdir())
    read = read_within_limits("tests.simulate.shapes.test_meshes:read", files, cpu_s=5)
    whole = {f"whole.{kind}" for kind in ("obj", "off", "stl", "ply")}
    assert read == {*whole, "polygon.obj", "polygon_lines.obj"}
