# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Commands in a process of their own, which can be stopped."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager

# A shell that starts the tests in the background has them ignore Ctrl-C, and all that they start.
PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    " import torch; torch.set_num_threads(1); from wildshape.cli.main import main; main()"
)


@contextmanager
def running(*arguments):
    command = [sys.executable, "-c", PROGRAM, *(str(argument) for argument in arguments)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(condition, process):
    until = time.monotonic() + 300
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.002)
