# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PCD: the header is parsed and checked here, the numbers are numpy's and LZF's.

Not pypcd4's reader (its writer is used): it allocates what a header promises, and holds a file
several times.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO

import numpy as np
from jaxtyping import Float, Num

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise, lines_of, reading

_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_HEADER_LINES = 200
_FREE_BYTES, _USUAL_ROW = 32_000_000, 32
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

    @property
    def kinds(self) -> list[str]:
        """Numpy's names of the fields' types, little endian."""
        return [f"<{kind.lower()}{size}" for kind, size in zip(self.types, self.sizes)]


def read_pcd(path: Path) -> Float[np.ndarray, "n 3"]:
    """The fields x y z, in the file's unit; VIEWPOINT is not applied (points stay as written).

    Raises:
        BadInputError: no PCD, or a header that lies about the file.
    """
    with path.open("rb") as file:
        header = _read_header(file, path)
        points = _read(file, header, path, _AXES).astype(np.float64, copy=False)
    if len(points) != header.points:
        raise BadInputError(
            f"{path}: the header promises {header.points} points, the file holds {len(points)}: "
            "truncated; copy it again."
        )
    return points


def read_pcd_field(path: Path, names: tuple[str, ...]) -> Num[np.ndarray, "n"] | None:
    """The first of these fields of each point, as written; None where there is none of them.

    Raises:
        BadInputError: as `read_pcd`.
    """
    with reading(path, "a PCD file"), path.open("rb") as file:
        header = _read_header(file, path)
        found = [name for name in names if name in header.fields]
        return _read(file, header, path, found[:1])[:, 0] if found else None


def _read(
    file: IO[bytes], header: _Header, path: Path, names: Sequence[str]
) -> Num[np.ndarray, "n k"]:
    """The first number of some fields, of each point, in the narrowest type that holds them all."""
    present = path.stat().st_size - file.tell()
    if header.encoding == "ascii":
        return _read_ascii(file, header, present, path, names)
    places = [header.fields.index(name) for name in names]
    if header.encoding == "binary_compressed":
        return np.stack(_columns(_unpacked(file, header, present, path), header, places), -1)
    check_promise(path, "points", header.points, header.points * header.row_bytes, present)
    # The fields of a row are named by their place.
    fields = [(f"{i}", kind, (n,)) for i, (kind, n) in enumerate(zip(header.kinds, header.counts))]
    rows = np.frombuffer(file.read(header.points * header.row_bytes), np.dtype(fields))
    return np.stack([rows[f"{place}"][:, 0] for place in places], -1)


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


def _read_ascii(
    file: IO[bytes], header: _Header, present: int, path: Path, names: Sequence[str]
) -> Float[np.ndarray, "n k"]:
    check_promise(
        path, "points", header.points, header.points * 2 * sum(header.counts) - 1, present
    )
    lines = lines_of(file, path)
    first = next(lines, None)
    if first is None:
        return np.empty((0, len(names)))
    columns = [sum(header.counts[: header.fields.index(name)]) for name in names]
    return np.loadtxt(chain([first], lines), usecols=columns, ndmin=2, comments=None)


def _unpacked(file: IO[bytes], header: _Header, present: int, path: Path) -> bytes:
    """What LZF packed: all of x, then all of y and so on."""
    import lzf  # pypcd4 brings it  # pyright: ignore[reportMissingImports]

    need = header.points * header.row_bytes
    check_promise(path, "points", header.points, min(need, 8), present)
    packed, unpacked = struct.unpack("<II", file.read(8).ljust(8, b"\0"))
    if header.points and (packed > present - 8 or unpacked != need or need > _LZF_RATIO * packed):
        raise BadInputError(
            f"{path}: the header promises {header.points} points ({need} bytes), the "
            f"compressed body says {unpacked} bytes in {packed}, {max(present - 8, 0)} are there: "
            "truncated or damaged; copy it again."
        )
    if need > _FREE_BYTES + max(8 * packed, _USUAL_ROW * header.points):
        raise BadInputError(
            f"{path}: {packed} bytes unpack to {need} for {header.points} points, which no scan"
            " does: write fewer fields."
        )
    body = lzf.decompress(file.read(packed), need) if header.points else b""
    if len(body or b"") != need:
        raise BadInputError(f"{path}: its compressed body is damaged; copy it again.")
    return body or b""


def _columns(body: bytes, header: _Header, places: list[int]) -> list[Num[np.ndarray, "n"]]:
    """The first number of some fields, of each point."""
    starts = np.cumsum([0, *(size * n for size, n in zip(header.sizes, header.counts))])
    return [
        np.frombuffer(
            body, header.kinds[i], header.points * header.counts[i], int(starts[i]) * header.points
        )[:: header.counts[i]]
        for i in places
    ]
