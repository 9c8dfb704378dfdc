# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A library that is absent or no library at all is silently None."""

from pathlib import Path

import pytest

from wildshape.ops import library as module


@pytest.mark.parametrize("content", [None, b"", b"no library"])
def test_unusable_library_is_none(content, tmp_path, monkeypatch):
    path: Path = tmp_path / "libwildshape_ops.so"
    if content is not None:
        path.write_bytes(content)
    monkeypatch.setattr(module, "_PATH", path)
    assert module.library.__wrapped__() is None
