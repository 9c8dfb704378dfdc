# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Feather tables: read as pyarrow reads them, none unpacked that claims too much."""

import struct
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather
from tests.io.limits import read_within_limits

from wildshape.datasets.argoverse2.feather import read_feather
from wildshape.datasets.argoverse2.unpacked import unpacked_bytes
from wildshape.errors import BadInputError

_NAMES = ("timestamp_ns", "category", "x")


def _columns(rows: int) -> dict[str, pa.Array]:
    rng = np.random.default_rng(0)
    texts = pa.array([f"class {i % 3}" for i in range(rows)], pa.string())
    return {
        "timestamp_ns": pa.array(np.arange(rows)),
        "unread": pa.array(["much more text"] * rows, pa.string()),
        "category": texts.dictionary_encode(),
        "x": pa.array(rng.random(rows).astype(np.float16)),
    }


@pytest.mark.parametrize("compression", ["uncompressed", "lz4", "zstd"])
@pytest.mark.parametrize("rows", [0, 1, 1000])
def test_a_table_is_read_as_by_pyarrow(compression: str, rows: int, tmp_path: Path) -> None:
    path, table = tmp_path / "a.feather", pa.table(_columns(rows))
    feather.write_feather(table, path, compression, chunksize=400)
    found = read_feather(path, ("x", "timestamp_ns", "category"), "download it")
    for name in _NAMES:
        np.testing.assert_array_equal(found[name], table[name].to_numpy())
    stream = pa.BufferReader(path.read_bytes()[8:])
    assert (unpacked_bytes(stream) >= 28 * rows) == (compression != "uncompressed" or not rows)


def read(path: Path) -> np.ndarray:
    """One column."""
    return read_feather(path, ("timestamp_ns",), "download it")["timestamp_ns"]


def _bombs(folder: Path) -> None:
    one = pa.table({"timestamp_ns": np.zeros(20_000_000, np.int64)})
    feather.write_feather(one, folder / "zeros.feather", "zstd")
    texts = pa.array(["a"] * 100, pa.string()).dictionary_encode()
    more = one.append_column("category", pa.chunked_array([texts.take(pa.array([0] * len(one)))]))
    feather.write_feather(more.slice(0, 100), folder / "few.feather", "zstd")
    feather.write_feather(one.slice(0, 1000), folder / "whole.feather", "zstd")
    data = (folder / "whole.feather").read_bytes()
    for name, claimed in (("huge", 1 << 40), ("negative", -5), ("short", 79_000_000)):
        claims = data.replace(struct.pack("<q", 8000), struct.pack("<q", claimed))
        assert claims != data
        (folder / f"{name}.feather").write_bytes(claims)


def test_no_table_costs_more_than_it_holds(tmp_path: Path) -> None:
    _bombs(tmp_path)
    files = sorted(tmp_path.iterdir())
    found = read_within_limits("tests.datasets.argoverse2.test_feather:read", files, cpu_s=5)
    assert found == {"few.feather", "whole.feather"}


def test_what_unpacks_to_too_much_is_said(tmp_path: Path) -> None:
    _bombs(tmp_path)
    for name in ("zeros", "huge"):
        with pytest.raises(BadInputError, match=rf"{name}\.feather: .* bytes unpack to \d+"):
            read(tmp_path / f"{name}.feather")
