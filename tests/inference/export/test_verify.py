# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Exports that are killed, or find no room: nothing stays beside the model."""

import errno
import os
import signal
import subprocess
import sys

import pytest

from wildshape.inference.export import onnx
from wildshape.inference.export.verify import export_model

_KILLED = """
import os, signal, sys
from pathlib import Path
from wildshape.inference.export import onnx, verify

onnx.trace = lambda _: os.kill(os.getpid(), signal.SIGKILL)
verify.export_model(None, Path(sys.argv[1]))
"""


@pytest.fixture
def full_disk(monkeypatch):
    def fill(path, *_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(onnx, "trace", lambda _: None)
    monkeypatch.setattr(onnx, "write_torch", fill)


def test_what_a_killed_export_left_goes_with_the_next(full_disk, tmp_path):
    out = tmp_path / "out.pt2"
    killed = subprocess.run([sys.executable, "-c", _KILLED, out])
    assert killed.returncode == -signal.SIGKILL
    assert list(tmp_path.iterdir())
    with pytest.raises(OSError, match="No space left"):
        export_model(None, out)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_names_the_file_that_was_asked_for(full_disk, tmp_path):
    with pytest.raises(OSError, match="No space left") as full:
        export_model(None, tmp_path / "out.pt2")
    assert full.value.filename == str(tmp_path / "out.pt2")
    assert not list(tmp_path.iterdir())
