# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""glTF files are read as trimesh reads them, and never cost more than they hold."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from tests.io.limits import read_within_limits
from tests.refusal import refused

from wildshape.simulate.shapes.gltf import read_gltf
from wildshape.simulate.shapes.meshes import read_mesh

_POINTS = np.array([[0, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 1]], "<f4").tobytes()
_CORNERS = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "<u4").tobytes()
_POSITION = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
_INDICES = {"bufferView": 1, "componentType": 5125, "count": 12, "type": "SCALAR"}
_PRIMITIVE = {"attributes": {"POSITION": 0}, "indices": 1}
_MESH = {"primitives": [_PRIMITIVE]}


def _header(points: int = 48, corners: int = 48, **changed: Any) -> dict[str, Any]:
    views = [{"buffer": 0, "byteLength": points}]
    views.append({"buffer": 0, "byteOffset": points, "byteLength": corners})
    whole = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [_MESH],
        "accessors": [_POSITION, _INDICES],
        "bufferViews": views,
        "buffers": [{"byteLength": points + corners}],
    }
    return {**whole, **changed}


def _glb(header: dict, binary: bytes = _POINTS + _CORNERS) -> bytes:
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<III", 2, 28 + len(text) + len(binary), len(text))
    return head + b"JSON" + text + struct.pack("<I", len(binary)) + b"BIN\0" + binary


def _same(path: Path) -> None:
    """The same surface as trimesh's, corner by corner."""
    vertices, faces = read_gltf(path)
    theirs: Any = trimesh.load(path, force="mesh", process=False)
    ours = vertices[faces].reshape(-1, 9)
    expected = np.asarray(theirs.triangles).reshape(-1, 9)
    order, theirs_order = np.lexsort(ours.round(6).T), np.lexsort(expected.round(6).T)
    np.testing.assert_allclose(ours[order], expected[theirs_order], atol=1e-9)


def test_a_scene_of_moved_turned_and_mirrored_parts_is_trimeshs(tmp_path: Path) -> None:
    rng, scene = np.random.default_rng(0), trimesh.Scene()
    parent: Any = None
    for i in range(6):
        T = trimesh.transformations.random_rotation_matrix(rng.random(3))
        T[:3, 3] = rng.normal(size=3)
        T[:3, :3] *= -1 if i % 2 else 2
        part = trimesh.creation.icosphere(i % 3) if i != 4 else scene.geometry["part1"]
        parent = scene.add_geometry(
            part, geom_name=f"part{i}", parent_node_name=parent if i % 2 else None, transform=T
        )
    for kind in ("glb", "gltf"):
        path = tmp_path / kind / f"car.{kind}"
        path.parent.mkdir()
        scene.export(path)
        _same(path)


@pytest.mark.parametrize("code", [5121, 5123, 5125])
def test_strips_strides_small_numbers_and_corners_left_out(code: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    kind = {5121: "<u1", 5123: "<u2", 5125: "<u4"}[code]
    rows = np.zeros(12, [("xyz", "<f4", 3), ("more", "<f4", 2)])
    rows["xyz"] = rng.normal(size=(12, 3))
    corners = rng.permutation(12).astype(kind).tobytes()
    primitives = [
        {**_PRIMITIVE, "mode": 5},
        _PRIMITIVE,
        {"attributes": {"POSITION": 0}},
        {"attributes": {"POSITION": 0}, "mode": 1},  # lines are no surface
    ]
    header = _header(
        rows.nbytes,
        len(corners),
        meshes=[{"primitives": primitives}],
        accessors=[{**_POSITION, "count": 12}, {**_INDICES, "componentType": code, "count": 12}],
    )
    header["bufferViews"][0]["byteStride"] = 20
    path = tmp_path / "car.glb"
    path.write_bytes(_glb(header, rows.tobytes() + corners))
    assert len(read_gltf(path)[1]) == 10 + 4 + 4
    _same(path)


@pytest.mark.parametrize(("code", "kind"), [(5120, "<i1"), (5122, "<i2"), (5123, "<u2")])
@pytest.mark.parametrize("normalized", [False, True])
def test_points_in_whole_numbers(code: int, kind: str, normalized: bool, tmp_path: Path) -> None:
    """As shares of the largest number of their type if they are normalised (glTF 2.0, 3.6.2.2)."""
    info = np.iinfo(kind)
    points = np.array([[0, 0, 0], [info.max, 0, 0], [0, 7, 0], [0, 0, max(info.min, -100)]], kind)
    binary = np.pad(points, ((0, 0), (0, 1))).tobytes()  # rows begin at multiples of 4 bytes
    position = {**_POSITION, "componentType": code, "normalized": normalized}
    header = _header(len(binary), accessors=[position, _INDICES])
    header["bufferViews"][0]["byteStride"] = len(binary) // 4
    path = tmp_path / "car.glb"
    path.write_bytes(_glb(header, binary + _CORNERS))
    largest = info.max if normalized else 1
    np.testing.assert_allclose(read_gltf(path)[0], points / largest)


def test_buffers_inside_of_the_text_and_beside_the_file(tmp_path: Path) -> None:
    (tmp_path / "a car.bin").write_bytes(_POINTS + _CORNERS)
    encoded = base64.b64encode(_POINTS + _CORNERS).decode()
    for name, uri in (
        ("inside", f"data:application/octet-stream;base64,{encoded}"),
        ("beside", "a car.bin"),
        ("quoted", "a%20car.bin"),
    ):
        header = _header(buffers=[{"byteLength": 96, "uri": uri}])
        (tmp_path / f"{name}.gltf").write_text(json.dumps(header))
        assert read_mesh(tmp_path / f"{name}.gltf", metres=True).vertices.shape == (4, 3)


@pytest.mark.parametrize("uri", ["../car.bin", "/dev/zero", "none.bin", ".", "http://a/b.bin"])
def test_a_buffer_that_is_no_file_of_the_folder_is_refused(uri: str, tmp_path: Path) -> None:
    (tmp_path / "car.bin").write_bytes(_POINTS + _CORNERS)
    path = tmp_path / "in" / "car.gltf"
    path.parent.mkdir()
    path.write_text(json.dumps(_header(buffers=[{"byteLength": 96, "uri": uri}])))
    refused(read_mesh, path, metres=True, match=r"car\.gltf needs the file .* in its folder")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"accessors": [_POSITION, {**_INDICES, "bufferView": None, "sparse": {}}]}, "compressed"),
        ({"accessors": [{"componentType": 5126, "count": 4, "type": "VEC3"}, _INDICES]}, "compres"),
        ({"asset": {"version": "1.0"}}, "older glTF"),
        ({"accessors": [{**_POSITION, "count": 5}, _INDICES]}, "cannot be read as a mesh"),
        ({"accessors": [{**_POSITION, "count": -1}, _INDICES]}, "cannot be read as a mesh"),
        ({"accessors": [{**_POSITION, "byteOffset": -12}, _INDICES]}, "cannot be read as a mesh"),
        ({"accessors": [_INDICES, _INDICES]}, "SCALAR where VEC3 belongs"),
        ({"accessors": [{**_POSITION, "count": 3}, {**_INDICES}]}, "none of its 3 vertices"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "shown twice"),
        ({"scenes": [{}]}, "no triangles"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(changed: dict, message: str, tmp_path: Path) -> None:
    path = tmp_path / "car.glb"
    path.write_bytes(_glb(_header(**changed)))
    refused(read_mesh, path, metres=True, match=rf"car\.glb.*{message}")


def _crafted(folder: Path) -> None:
    """Headers that promise, repeat or nest far more than the file holds."""

    def write(name: str, header: dict, binary: bytes = _POINTS + _CORNERS) -> None:
        (folder / f"{name}.glb").write_bytes(_glb(header, binary))

    write("whole", _header())
    for name, at, lie in (("json", 12, -1), ("binary", -100, -1)):
        data = bytearray((folder / "whole.glb").read_bytes())
        data[at : at + 4] = struct.pack("<i", lie)[:4]
        (folder / f"{name}.glb").write_bytes(data)
    absent = {"componentType": 5125, "count": 30_000_000, "type": "SCALAR"}
    write("absent", _header(accessors=[_POSITION, absent]))
    views = _header()["bufferViews"] + [{"buffer": 0, "byteLength": 5_000_096}] * 200
    more = [{"bufferView": 2, "componentType": 5121, "count": 5_000_000, "type": "SCALAR"}] * 200
    padded = _POINTS + _CORNERS + bytes(5_000_000)
    write("views", _header(bufferViews=views), padded)
    write(
        "accessors", _header(bufferViews=views[:3], accessors=[_POSITION, _INDICES, *more]), padded
    )
    many = _CORNERS * 50_000
    indices = {**_INDICES, "count": len(many) // 4}
    shown = {"nodes": [{"mesh": 0}] * 200, "scenes": [{"nodes": list(range(200))}]}
    accessors = [_POSITION, indices]
    write("shown", _header(48, len(many), accessors=accessors, **shown), _POINTS + many)
    points = _POINTS * 100_000
    accessors = [{**_POSITION, "count": 400_000}, _INDICES]
    parts = [{"primitives": [_PRIMITIVE] * 200}]
    write("points", _header(len(points), accessors=accessors, meshes=parts), points + _CORNERS)
    chain = [{"mesh": 0, "children": [i + 1], "scale": [1, 1, 1]} for i in range(2000)]
    write("chain", _header(nodes=[*chain, {"mesh": 0}]))
    rng = np.random.default_rng(0)
    large = rng.random((500_000, 3), np.float32).tobytes()
    corners = rng.integers(0, 500_000, (500_000, 3), np.uint32).tobytes()
    accessors = [{**_POSITION, "count": 500_000}, {**_INDICES, "count": 1_500_000}]
    write("large", _header(len(large), len(corners), accessors=accessors), large + corners)
    (folder / "lists.gltf").write_text('{"a":[' + "[]," * 1_000_000 + "[]]}")


def test_no_header_costs_more_than_its_file_holds(tmp_path: Path) -> None:
    _crafted(tmp_path)
    files = sorted(tmp_path.iterdir())
    read = read_within_limits("tests.simulate.shapes.test_meshes:read", files, cpu_s=5)
    whole = ("whole", "views", "accessors", "points", "chain", "large")
    assert read == {f"{name}.glb" for name in whole}
