# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PCD through pypcd4, behind a header check: the library allocates what a header promises."""

import io
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_HEADER_LINES = 200
_LZF_RATIO = 100  # LZF writes at most 264 bytes for 3
_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class _Header:
    fields: list[str]
    sizes: list[int]
    types: list[str]
    counts: list[int]
    points: int
    encoding: str

    @property
    def row_bytes(self) -> int:
        return sum(size * count for size, count in zip(self.sizes, self.counts))

    def text(self) -> bytes:
        """The header that pypcd4 gets: complete, and no foreign names but x, y, z."""
        names = [f if f in _AXES else f"other{i}" for i, f in enumerate(self.fields)]
        rows = ("VERSION 0.7", ("FIELDS", *names), ("SIZE", *self.sizes), ("TYPE", *self.types))
        rows += (("COUNT", *self.counts), f"WIDTH {self.points}", "HEIGHT 1")
        rows += ("VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {self.points}", f"DATA {self.encoding}")
        lines = [row if isinstance(row, str) else " ".join(map(str, row)) for row in rows]
        return ("\n".join(lines) + "\n").encode()


def read_pcd(path: Path) -> Float[np.ndarray, "n 3"]:
    """The fields x y z, in the file's unit; VIEWPOINT is not applied (points stay as written).

    Raises:
        BadInputError: no PCD, or a header that lies about the file.
    """
    from pypcd4.pypcd4 import PointCloud

    with path.open("rb") as file:
        header = _read_header(file, path)
        present = path.stat().st_size - file.tell()
        body = _checked_body(file, header, present, path)
    if not header.points:
        return np.empty((0, 3))
    cloud = PointCloud.from_fileobj(io.BytesIO(header.text() + body))  # pyright: ignore[reportArgumentType]
    points = np.stack([np.atleast_1d(cloud.pc_data[axis]) for axis in _AXES], -1)
    if len(points) != header.points:
        raise BadInputError(
            f"{path}: the header promises {header.points} points, the file holds {len(points)}: "
            "truncated; copy it again."
        )
    return points.astype(np.float64)


def _read_header(file: IO[bytes], path: Path) -> _Header:
    found: dict[str, list[str]] = {}
    for _ in range(_HEADER_LINES):
        line = file.readline(65536)
        words = line.decode("latin-1").split()
        if words and not words[0].startswith("#"):
            found[words[0].upper()] = words[1:]
        if "DATA" in found or not line:
            break
    if not {"FIELDS", "SIZE", "TYPE", "DATA"} <= found.keys():
        raise BadInputError(
            f"{path}: expected a PCD header (FIELDS, SIZE, TYPE, POINTS, DATA), found "
            f"{', '.join(found)[:80] or 'none'}."
        )
    return _checked_header(found, path)


def _checked_header(found: dict[str, list[str]], path: Path) -> _Header:
    fields, types = found["FIELDS"], found["TYPE"]
    sizes = [int(word) for word in found["SIZE"]]
    counts = [int(word) for word in found.get("COUNT", ["1"] * len(fields))]
    if not len(fields) == len(types) == len(sizes) == len(counts):
        raise BadInputError(
            f"{path}: FIELDS, SIZE, TYPE and COUNT of the PCD header differ in length."
        )
    for kind, size, count in zip(types, sizes, counts):
        if size not in _SIZES.get(kind, ()) or not 0 < count < 65536:
            raise BadInputError(
                f"{path}: the PCD field type '{kind[:20]}' of {size} bytes x {count} is unknown; "
                "expected F, I or U of 1 to 8 bytes."
            )
    if any(fields.count(a) != 1 or counts[fields.index(a)] != 1 for a in _AXES):
        raise BadInputError(f"{path}: expected the PCD fields x, y and z, found {fields}.")
    encoding = "".join(found["DATA"]).lower()
    if encoding not in _ENCODINGS:
        raise BadInputError(
            f"{path}: PCD data '{encoding[:40]}' is unknown; use one of {_ENCODINGS}."
        )
    return _Header(fields, sizes, types, counts, _point_count(found), encoding)


def _point_count(found: dict[str, list[str]]) -> int:
    if "POINTS" in found:
        return int(found["POINTS"][0])
    return math.prod(int(found[key][0]) for key in ("WIDTH", "HEIGHT"))


def _checked_body(file: IO[bytes], header: _Header, present: int, path: Path) -> bytes:
    """The bytes after the header, once they are known to hold what it promises."""
    if header.encoding == "ascii":
        least = header.points * 2 * sum(header.counts) - 1
        check_promise(path, "points", header.points, least, present)
        lines = [line.split() for line in file.read().splitlines()]
        return b"\n".join(b" ".join(words) for words in lines if words)
    need = header.points * header.row_bytes
    if header.encoding == "binary":
        check_promise(path, "points", header.points, need, present)
        return file.read(need)
    check_promise(path, "points", header.points, min(need, 8), present)
    body = file.read()
    packed, unpacked = struct.unpack_from("<II", body + bytes(8))
    if header.points and (packed > present - 8 or unpacked != need or need > _LZF_RATIO * packed):
        raise BadInputError(
            f"{path}: the header promises {header.points} points ({need} bytes), the "
            f"compressed body says {unpacked} bytes in {packed}, {max(present - 8, 0)} are there: "
            "truncated or damaged; copy it again."
        )
    return body
