# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""numpy's files whose headers ask for memory before there is an array."""

import zipfile

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.io.scans.arrays import read_npy, read_npz


@pytest.mark.parametrize("version", [2, 3])
def test_a_header_longer_than_its_file_is_refused(tmp_path, version):
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY" + bytes((version, 0)) + (2**31).to_bytes(4, "little") + b"{")
    refused(read_npy, path, match=r"promises 2147483648 bytes of header")


@pytest.mark.parametrize("how", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_archives_of_other_packers_are_refused(tmp_path, how):
    np.save(tmp_path / "a.npy", np.ones((20, 3)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w", how) as archive:
        archive.write(tmp_path / "a.npy", "points.npy")
    refused(read_npz, tmp_path / "a.npz", match="packed in another way")
