# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A conversion on a local Ray cluster of two workers, one of which is killed at its work."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.cli.interrupted_source import Waiting

from wildshape.cli.conversion import Order, convert
from wildshape.io.store import open_store

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: not run"
)
PROGRAM = """
import sys
from pathlib import Path
from tests.cli.interrupted_source import Waiting
from wildshape.cli.conversion import Order, convert
root, out = map(Path, sys.argv[1:])
convert(Order("waiting", Waiting(root), out, "packed", None, {}, workers=2, ray="local"))
"""


def order(root, out, **how):
    return Order("waiting", Waiting(root), out, "packed", None, {}, **how)


def test_a_killed_worker_is_replaced_and_nothing_doubled(tmp_path):
    root, out = tmp_path / "root", tmp_path / "out"
    root.mkdir()
    paths = os.pathsep.join(path for path in sys.path if path)
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(root), str(out)],
        env={**os.environ, "PYTHONPATH": paths},
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        os.kill(holder(root, process), signal.SIGKILL)
        _, said = process.communicate(timeout=100)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0, said
    store = open_store(out)
    store.verify()
    assert store.names == ("a0", "a1", "b0", "b1", "c0", "c1", "d0", "d1")
    attempts = sorted((root / "attempts").read_text().split())
    assert attempts == ["a", "b", "b", "c", "d"]
    convert(order(root, tmp_path / "alone", workers=1))
    assert open_store(tmp_path / "alone").fingerprint == store.fingerprint


def holder(root: Path, process) -> int:
    """The process that holds part b, once there is one."""
    until = time.monotonic() + 100
    while not (root / "pid").exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.02)
    return int((root / "pid").read_text())
