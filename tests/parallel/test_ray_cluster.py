# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import importlib.util
import subprocess
import sys

import pytest

STOPPED = """
import signal, time
from wildshape.cli.terminal import Terminated, terminable
from wildshape.parallel.ray_cluster import on_ray
try:
    with terminable(), on_ray("local", 1):
        signal.raise_signal(signal.SIGTERM)
        time.sleep(60)
except Terminated:
    print("stopped as anywhere")
"""


@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed: not run")
def test_a_signal_ends_work_on_ray_as_it_does_without():
    """Ray took SIGTERM for itself: a dump of the stack in place of a sentence."""
    command = [sys.executable, "-c", STOPPED]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert said.stdout == "stopped as anywhere\n", said.stderr
