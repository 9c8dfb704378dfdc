# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A conversion on a local Ray cluster of two workers, one of which is killed at its work."""

import importlib.util
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from tests.cli.interrupted_source import Waiting

from wildshape.datasets.convert import ConversionOptions, convert
from wildshape.io.store.store import open_store

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: not run"
)
PROGRAM = """
import sys
from pathlib import Path
from tests.cli.interrupted_source import Waiting
from wildshape.datasets.convert import ConversionOptions, convert
root, out = map(Path, sys.argv[1:])
convert(Waiting(root), out, ConversionOptions(workers=2, ray="local"))
"""


def test_a_killed_worker_is_replaced_and_nothing_doubled(tmp_path):
    root, out = tmp_path / "root", tmp_path / "out"
    root.mkdir()
    with under_way(root, out) as process:
        os.kill(int((root / "pid").read_text()), signal.SIGKILL)
        _, said = process.communicate(timeout=200)
    assert process.returncode == 0, said
    store = open_store(out)
    store.verify()
    assert store.names == ("a0", "a1", "b0", "b1", "c0", "c1", "d0", "d1")
    attempts = sorted((root / "attempts").read_text().split())
    assert attempts == ["a", "b", "b", "c", "d"]
    convert(Waiting(root), tmp_path / "alone", ConversionOptions(workers=1))
    assert open_store(tmp_path / "alone").fingerprint == store.fingerprint


@contextmanager
def under_way(root, out):
    """The conversion, once part b is held by a worker.

    Ray itself gives up where its own processes need more than about 15 s to start, as they may on a
    machine with much other work: it is started again then, and the test not run if that is so.
    """
    said = ""
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = {**os.environ, "PYTHONPATH": paths}
    command = [sys.executable, "-c", PROGRAM, str(root), str(out)]
    for _ in range(2):
        process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        try:
            if held(root, process):
                yield process
                return
        finally:
            process.kill()
            said = process.communicate()[1]
    busy, cores = os.getloadavg()[0], os.cpu_count() or 1
    if busy > 3 * cores:
        pytest.skip(
            f"Ray did not start beside {busy:.0f} other processes on {cores} cores: not run"
        )
    pytest.fail(f"Ray did not start: {said}")


def held(root, process):
    until = time.monotonic() + 60
    while not (root / "pid").exists() and process.poll() is None and time.monotonic() < until:
        time.sleep(0.02)
    return (root / "pid").exists()
