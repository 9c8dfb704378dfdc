# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A file's content alone tells its kind."""

import numpy as np
import pytest

from wildshape.io.scans.recognise import suffix_of
from wildshape.io.scans.writers import CLOUD_SUFFIXES, save

POINTS = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n"


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_what_we_write_is_known_again(suffix, tmp_path):
    save(POINTS, tmp_path / f"a{suffix}")
    expected = ".xyz" if suffix == ".txt" else suffix
    assert suffix_of((tmp_path / f"a{suffix}").read_bytes()) == expected


@pytest.mark.parametrize(
    ("data", "suffix"),
    [
        (PCD.encode(), ".pcd"),
        (f"# .PCD v0.7\n{PCD}".encode(), ".pcd"),
        (b"\xef\xbb\xbfx,y,z\n1,2,3\n", ".xyz"),
        (b"// by hand\n1 2 3\r\n", ".xyz"),
        (b"no numbers here\n", ""),
        (b"plyable 1 2 3", ".xyz"),
        (b"", ""),
        (np.abs(POINTS).tobytes(), ""),
    ],
)
def test_kinds_of_others(data, suffix):
    assert suffix_of(data) == suffix


def test_an_archive_is_known_again(tmp_path):
    np.savez(tmp_path / "a.npz", points=POINTS)
    assert suffix_of((tmp_path / "a.npz").read_bytes()) == ".npz"
