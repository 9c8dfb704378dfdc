# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""No input makes the kernels read or write out of bounds: random calls under two sanitizers."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NATIVE = ROOT / "src/wildshape/ops/native"
CALLS = 5_000
FLAGS = ["-g", "-O1", "-fPIC", "-shared", "-ffp-contract=off", "-pthread"]
WATCHED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def watcher(compiler: list[str]) -> str:
    """The sanitizer's library, which must be loaded before all others; "" where it is absent."""
    command = [*compiler, "-print-file-name=libasan.so"]
    found = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return found if Path(found).is_file() else ""


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory):
    """The kernels, watched, and the environment that runs them."""
    compiler = shlex.split(os.environ.get("CC") or "gcc")
    if not shutil.which(compiler[0]):
        pytest.skip(f"the sanitizers need a C compiler, and there is no {compiler[0]}")
    library, asan = tmp_path_factory.mktemp("sanitized") / "kernels.so", watcher(compiler)
    if not asan:
        pytest.skip(f"{compiler[0]} has no AddressSanitizer (libasan.so)")
    sources = sorted(map(str, NATIVE.glob("*.c")))
    subprocess.run([*compiler, *FLAGS, *WATCHED, "-o", str(library), *sources, "-lm"], check=True)
    watched = {
        "LD_PRELOAD": asan,
        "ASAN_OPTIONS": "detect_leaks=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONPATH": str(ROOT / "src"),
        "OMP_NUM_THREADS": "1",
    }
    return library, os.environ | watched


def watched_run(sanitized, *arguments):
    library, environment = sanitized
    command = [sys.executable, str(ROOT / "tests/ops/random_calls.py"), str(library), *arguments]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=600, check=False
    )


def test_random_calls_stay_in_bounds_and_agree_with_torch(sanitized):
    done = watched_run(sanitized, str(CALLS))
    assert done.returncode == 0, done.stderr[-4000:]
    for kind in (
        "nearest",
        "nearest_k",
        "connected",
        "spans",
        "gradient",
        "column_argmax",
        "visible",
        "planes",
        "point_to",
        "wrongly",
    ):
        assert f"call_{kind}" in done.stdout


def test_the_sanitizer_watches(sanitized, tmp_path):
    """A call that reads past its end is caught: else the test above would show nothing."""
    library, environment = sanitized
    program = (
        "import ctypes, sys; k = ctypes.CDLL(sys.argv[1]); a = (ctypes.c_float * 3)();"
        " k.wildshape_column_argmax(a, ctypes.c_int64(10**7), ctypes.c_int64(1),"
        " (ctypes.c_int64 * 1)(), 0)"
    )
    command = [sys.executable, "-c", program, str(library)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert "AddressSanitizer" in done.stderr
    assert "column_argmax.c" in done.stderr
