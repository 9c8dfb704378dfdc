# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files made to cost more than they hold: every reader keeps to the rule of `limits.py`."""

import struct
from pathlib import Path

import numpy as np
from tests.io.limits import allowed, costs, read_within_limits

_READER = "wildshape.io.scans.points:read_points"


def test_what_is_measured_is_what_a_reader_takes(tmp_path: Path) -> None:
    whole, missing = tmp_path / "whole.bin", tmp_path / "missing.bin"
    np.random.default_rng(0).random((2_000_000, 4), np.float32).tofile(whole)
    read, refused = costs(_READER, [whole, missing])
    assert read.points == 2_000_000
    assert 12 * read.points < read.grown < allowed(whole, read.points) == 384_000_000
    assert refused.error == f"BadInputError: {missing}: no such file; check the path."
    assert refused.is_answer
    assert refused.grown < read.grown / 4


_PLY = "ply\nformat {} 1.0\n{}end_header\n"
_XYZ = "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
_FACES = "element face {}\nproperty list uchar int vertex_indices\n"
_LITTLE = "binary_little_endian"


def _pcd(fields: int, encoding: str, points: int, count: int = 1) -> bytes:
    names = "FIELDS x y z" + " a" * fields + "\nSIZE 4 4 4" + " 8" * fields
    kinds = "\nTYPE F F F" + " F" * fields + "\nCOUNT 1 1 1" + f" {count}" * fields
    return f"VERSION 0.7\n{names}{kinds}\nPOINTS {points}\nDATA {encoding}\n".encode()


def _crafted(folder: Path, formats: dict[str, Path]) -> None:
    """Small files that promise, unpack to, or walk through far more than they hold."""
    import lzf

    points, rng = np.zeros((60, 3), np.float32).tobytes(), np.random.default_rng(0)
    for name in ("format3.las", "format3.laz", "format6.laz"):
        data = formats[name].read_bytes()
        start = struct.unpack_from("<I", data, 96)[0]
        for what, at, lie in (
            ("records", 96, struct.pack("<II", 0xFFFFFFF, 10**8)),
            ("records_there", 100, struct.pack("<I", 10**6)),
            ("start", 96, b"\xff" * 4),
            ("size", 94, b"\xff" * 2),
        ):
            changed = data[:at] + lie + data[at + len(lie) :]
            (folder / f"{what}_{name}").write_bytes(changed)
        full = struct.pack("<II", start + 54 * 100_000, 100_000)
        body = data[:96] + full + data[104:start] + bytes(54 * 100_000) + data[start:]
        (folder / f"full_{name}").write_bytes(body)
    np.savez_compressed(folder / "points.npz", points=np.zeros((4_000_000, 3)))
    np.savez_compressed(folder / "wide.npz", points=np.zeros((20_000, 1000), np.float32))
    np.savez_compressed(folder / "row.npz", points=np.zeros((3, 7_000_000), np.float32))
    np.savez_compressed(folder / "beside.npz", points=np.ones((60, 3)), more=np.zeros(10_000_000))
    for name, rows in (("equal", bytes(5_000_000)), ("mixed", rng.bytes(2_000_000))):
        lists = rows if name == "equal" else bytes(b & 1 for b in rows[:1_000_000])
        items = b"".join(bytes([n]) + bytes(4 * n) for n in lists) if name == "mixed" else lists
        head = _PLY.format(_LITTLE, _FACES.format(len(lists)) + _XYZ.format(60))
        (folder / f"{name}_faces.ply").write_bytes(head.encode() + items + points)
    tagged = _XYZ.format(300_000) + "property list uchar uchar tags\n"
    (folder / "tagged.ply").write_bytes(_PLY.format(_LITTLE, tagged).encode() + bytes(3_900_000))
    text = _PLY.format("ascii", tagged).encode() + b"1 2 3 0\n" * 300_000
    (folder / "tagged_text.ply").write_bytes(text)
    text = _PLY.format("ascii", _XYZ.format(600_000)).encode() + b"1 2 3\n" * 600_000
    (folder / "text.ply").write_bytes(text)
    (folder / "text.pcd").write_bytes(_pcd(0, "ascii", 600_000) + b"1 2 3\n" * 600_000)
    packed = lzf.compress(bytes(60 * (12 + 4 * 8 * 25_000)))
    size = struct.pack("<II", len(packed), 60 * (12 + 4 * 8 * 25_000))
    (folder / "wide.pcd").write_bytes(_pcd(4, "binary_compressed", 60, 25_000) + size + packed)
    packed = lzf.compress(bytes(12 * 2_000_000))
    size = struct.pack("<II", len(packed), 12 * 2_000_000)
    (folder / "equal.pcd").write_bytes(_pcd(0, "binary_compressed", 2_000_000) + size + packed)


def test_no_file_costs_more_than_it_holds(formats: dict[str, Path], tmp_path: Path) -> None:
    _crafted(tmp_path, formats)
    files = sorted(tmp_path.iterdir())
    read = read_within_limits(_READER, files, cpu_s=5)
    whole = "beside.npz equal.pcd equal_faces.ply mixed_faces.ply tagged.ply tagged_text.ply"
    assert read == {*whole.split(), "text.pcd", "text.ply"}


def test_a_point_takes_64_bytes_at_most(tmp_path: Path) -> None:
    count = 3_000_000
    steps = np.arange(count, dtype=np.float32)[:, None] * np.array([1e-6, 0, 0], np.float32)
    np.savez_compressed(tmp_path / "a.npz", points=steps.astype(np.float64))
    steps[:, :1].repeat(4, 1).tofile(tmp_path / "a.bin")
    files = [tmp_path / "a.npz", tmp_path / "a.bin"]
    for cost in costs(_READER, files):
        assert cost.points == count
        assert cost.grown < 64 * count
