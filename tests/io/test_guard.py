# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged files of every format: a valid result or one sentence, and no memory for a lie."""

import errno
from pathlib import Path

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.io import guard
from wildshape.io.guard import reading
from wildshape.io.scans.points import read_points

_PLY = ("plain.ply", "binary_big_endian.ply", "ascii.ply")
_PCD = ("ascii.pcd", "binary.pcd", "binary_compressed.pcd")


@pytest.mark.parametrize("count", [61, 10**9, 10**15, 10**30, -1])
@pytest.mark.parametrize("name", [*_PLY, *_PCD])
def test_ply_and_pcd_header_that_lies_about_the_count(
    name: str, count: int, formats: dict[str, Path], tmp_path: Path
) -> None:
    said = b"vertex" if name in _PLY else b"POINTS"
    data = formats[name].read_bytes().replace(said + b" 60", said + b" %d" % count)
    _refused(tmp_path / f"a{Path(name).suffix}", data)


@pytest.mark.parametrize("count", [61, 10**9, 2**32 - 1, 10**15])
@pytest.mark.parametrize(("kind", "at", "size"), [("format3", 107, 4), ("format6", 247, 8)])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_header_that_lies_about_the_count(
    kind: str, at: int, size: int, suffix: str, count: int, formats, tmp_path: Path
) -> None:
    data = bytearray(formats[kind + suffix].read_bytes())
    data[at : at + size] = count.to_bytes(8, "little")[:size]
    _refused(tmp_path / f"a{suffix}", bytes(data))


@pytest.mark.parametrize("shape", [b"(99, 3)", b"(1000000000000000, 3)", b"(-60, 3)"])
def test_npy_header_that_lies_about_the_shape(
    shape: bytes, formats: dict[str, Path], tmp_path: Path
) -> None:
    header, _, body = formats["array.npy"].read_bytes().partition(b"\n")
    lie = header.rstrip().replace(b"(60, 3)", shape).ljust(len(header))
    length = len(lie) - 10 + 1
    lie = lie[:8] + length.to_bytes(2, "little") + lie[10:]
    _refused(tmp_path / "a.npy", lie + b"\n" + body)


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    _refused(tmp_path / "a.npy", (tmp_path / "a.npy").read_bytes())


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b"property float x", b"property quad x", "type 'quad' is unknown"),
        (b"property float x", b"property float w", "x, y and z"),
        (b"element vertex", b"element points", "x, y and z"),
        (b"binary_little_endian", b"zipped", "format 'zipped'"),
        (b"end_header", b"", "makes no sense|does not end"),
        (b"ply\n", b"PK\n", "first line 'ply'"),
    ],
)
def test_ply_headers_that_make_no_sense(
    old: bytes, new: bytes, said: str, formats: dict[str, Path], tmp_path: Path
) -> None:
    data = formats["plain.ply"].read_bytes().replace(old, new, 1)
    _refused(tmp_path / "a.ply", data, said)


def test_kitti_of_a_broken_size(tmp_path: Path) -> None:
    _refused(tmp_path / "a.bin", bytes(16 * 20 + 4), "324 bytes")


class PanicException(BaseException):
    """What pyo3 raises when Rust panics: no `Exception`."""


def test_panics_are_caught_and_interrupts_are_not() -> None:
    with pytest.raises(BadInputError, match="mid > len"), reading(Path("a.laz"), "a LAZ file"):
        raise PanicException("mid > len")
    with pytest.raises(KeyboardInterrupt), reading(Path("a.laz"), "a LAZ file"):
        raise KeyboardInterrupt


def _refused(path: Path, data: bytes, said: str = "header|points|file") -> None:
    path.write_bytes(data)
    refused(read_points, path, match=said)


@pytest.mark.parametrize("error", [MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory")])
def test_a_lack_of_memory_is_no_damaged_file(
    error: Exception, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file that is skipped because memory was short would be missing without a word."""
    path = tmp_path / "whole.ply"
    path.touch()

    def none_left(*_: object) -> None:
        raise OSError(errno.ENOMEM, "Cannot allocate memory")

    monkeypatch.setattr(guard, "mmap", none_left)
    with pytest.raises(MemoryError), reading(path, "a scan"):
        raise error


def test_a_file_that_asks_for_more_than_any_scan_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "greedy.ply"
    path.touch()
    with (
        pytest.raises(BadInputError, match=r"greedy\.ply: expected a scan"),
        reading(path, "a scan"),
    ):
        raise MemoryError
