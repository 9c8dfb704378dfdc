# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Triangles of glTF files (.glb, .gltf), whose headers may promise far more than the files hold.

Materials, lines and points are left out. What the header says of points and triangles is compared
with the file before any of them is made (glTF 2.0, sections 3.5 to 3.7).
"""

import base64
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import parse_json
from wildshape.simulate.shapes.triangles import Triangles, joined, used

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC3": 3}
_TRIANGLES, _STRIP = 4, 5
# An instance is a copy: a few small parts are shown often, the whole file is not.
_FREE_ROWS, _BYTES_A_ROW = 1_000_000, 2


def read_gltf(path: Path) -> Triangles:
    """All triangles of the scene that a file shows, each part at its place.

    Raises:
        BadInputError: it shows far more than it holds, or is packed by an extension.
        Exception: of any kind; the file is damaged.
    """
    file = _opened(path)
    shown = list(_shown(file.header))
    rows = sum(file.rows(mesh) for mesh, _ in shown)
    if rows > _FREE_ROWS + file.size() // _BYTES_A_ROW:
        raise BadInputError(
            f"{path} shows {rows} points and triangles, far more than its {file.size()} bytes "
            "hold; export it anew, each part once."
        )
    meshes = {mesh: file.triangles(mesh) for mesh in {mesh for mesh, _ in shown}}
    return joined([meshes[mesh] for mesh, _ in shown], [T for _, T in shown])


@dataclass(frozen=True)
class _File:
    path: Path
    header: dict[str, Any]
    binary: bytes
    loaded: dict[str, bytes] = field(default_factory=dict)

    def size(self) -> int:
        """Bytes of the file and of those beside it that it needs."""
        uris = {buffer.get("uri", "") for buffer in self.header.get("buffers", ())}
        beside = (_beside(self.path, uri) for uri in uris if uri and not _is_inside(uri))
        return sum(path.stat().st_size for path in (self.path, *beside))

    def rows(self, mesh: int) -> int:
        """Points and triangles at most, as the header says."""
        found = 0
        for primitive in self._surfaces(mesh):
            points = self._count(primitive["attributes"]["POSITION"])
            corners = self._count(primitive["indices"]) if "indices" in primitive else points
            faces = corners if primitive.get("mode") == _STRIP else corners // 3
            found += faces + min(points, 3 * faces)
        return found

    def triangles(self, mesh: int) -> Triangles:
        """Those of all primitives of a mesh."""
        parts = [self._surface(primitive) for primitive in self._surfaces(mesh)]
        return parts[0] if len(parts) == 1 else joined(parts)

    def _surfaces(self, mesh: int) -> list[dict[str, Any]]:
        primitives = self.header["meshes"][mesh]["primitives"]
        return [p for p in primitives if p.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP)]

    def _surface(self, primitive: dict[str, Any]) -> Triangles:
        points = self._points(primitive["attributes"]["POSITION"])
        if "indices" in primitive:
            corners = self._numbers(primitive["indices"], "SCALAR")[:, 0]
        else:
            corners = np.arange(len(points))
        strip = primitive.get("mode") == _STRIP
        return used(points, _of_strip(corners) if strip else corners.reshape(-1, 3))

    def _points(self, accessor: int) -> np.ndarray:
        """Whole numbers may be shares of their type's largest (KHR_mesh_quantization)."""
        points = self._numbers(accessor, "VEC3")
        if points.dtype.kind == "f" or not self.header["accessors"][accessor].get("normalized"):
            return points
        return np.maximum(points / np.iinfo(points.dtype).max, -1.0)

    def _count(self, accessor: int) -> int:
        count = self.header["accessors"][accessor]["count"]
        if not isinstance(count, int) or count < 0:
            raise ValueError(f"{count!r} numbers")
        return count

    def _numbers(self, number: int, kind: str) -> np.ndarray:
        """`(count, columns)`, a view of the buffer."""
        accessor = self.header["accessors"][number]
        if "bufferView" not in accessor or "sparse" in accessor:
            raise BadInputError(
                f"{self.path} has points that are compressed or sparse; export it uncompressed."
            )
        if accessor["type"] != kind:
            raise ValueError(f"{accessor['type']} where {kind} belongs")
        dtype, columns = np.dtype(_TYPES[accessor["componentType"]]), _COLUMNS[kind]
        if kind == "SCALAR" and dtype.kind == "f":
            raise ValueError("corners that are no whole numbers")
        view = self.header["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", columns * dtype.itemsize)
        if stride <= 0:
            raise ValueError(f"byteStride {stride}")
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if min(start, length) < 0:
            raise ValueError("a negative place")
        # numpy checks that all lies inside.
        return np.ndarray(
            (self._count(number), columns),
            dtype,
            memoryview(self._buffer(view["buffer"]))[start : start + length],
            accessor.get("byteOffset", 0),
            (stride, dtype.itemsize),
        )

    def _buffer(self, number: int) -> bytes:
        uri = self.header["buffers"][number].get("uri")
        if uri is None:
            return self.binary
        if uri not in self.loaded:
            encoded = uri.partition("base64,")[2]
            inside = _is_inside(uri)
            read = base64.b64decode(encoded) if inside else _beside(self.path, uri).read_bytes()
            self.loaded[uri] = read
        return self.loaded[uri]


def _opened(path: Path) -> _File:
    data = path.read_bytes()
    chunks = dict(_chunks(data)) if path.suffix.lower() == ".glb" else {_JSON: data}
    text = chunks[_JSON].decode("utf-8-sig")
    header = parse_json(text, path, "a glTF mesh")
    if str(header.get("asset", {}).get("version", "2")).split(".")[0] != "2":
        raise BadInputError(f"{path} is of an older glTF, expected glTF 2; export it anew.")
    return _File(path, header, chunks.get(_BINARY, b""))


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    if data[:4] != _MAGIC or data[4:8] != b"\2\0\0\0":
        raise ValueError("no glTF 2")
    at = 12
    while at + 8 <= len(data):
        length, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + length > len(data):
            raise ValueError(f"a chunk of {length} bytes in a file of {len(data)}")
        yield kind, data[at + 8 : at + 8 + length]
        at += 8 + length


def _is_inside(uri: str) -> bool:
    return "base64," in uri


def _beside(path: Path, uri: str) -> Path:
    """The file that holds a buffer."""
    folder = os.path.normpath(path.parent.absolute())
    for name in (uri, unquote(uri)):
        found = Path(os.path.normpath(Path(folder, name)))
        if found.is_relative_to(folder) and found.is_file():
            return found
    raise BadInputError(f"{path} needs the file {uri[:80]!r} in its folder; copy it there.")


def _shown(header: dict[str, Any]) -> Iterator[tuple[int, np.ndarray]]:
    """The meshes of the scene, each with its transform from the mesh to the scene, `(4, 4)`."""
    nodes, seen = header.get("nodes", []), set[int]()
    scenes = header.get("scenes")
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else []
    left = [(root, np.eye(4)) for root in roots]
    while left:
        number, T_scene_parent = left.pop()
        node = nodes[number]
        if number in seen:
            raise ValueError(f"node {number} is shown twice")
        seen.add(number)
        T_scene_node = T_scene_parent @ _transform(node)
        left += [(child, T_scene_node) for child in node.get("children", ())]
        if "mesh" in node:
            yield node["mesh"], T_scene_node


def _transform(node: dict[str, Any]) -> np.ndarray:
    """`T_parent_node`, `(4, 4)`."""
    from trimesh import transformations

    T = np.eye(4)
    if "matrix" in node:
        T = np.array(node["matrix"], np.float64).reshape(4, 4).T
    if "translation" in node:
        T = T @ transformations.translation_matrix(node["translation"])
    if "rotation" in node:
        x, y, z, w = node["rotation"]
        T = T @ transformations.quaternion_matrix((w, x, y, z))
    if "scale" in node:
        T = T @ np.diag((*node["scale"], 1.0))
    return T


def _of_strip(corners: np.ndarray) -> np.ndarray:
    """The triangles of a strip, every other one turned back."""
    faces = np.stack((corners[:-2], corners[1:-1], corners[2:]), axis=1)
    faces[1::2] = faces[1::2, ::-1].copy()
    return faces
