# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The way of one scan from the command to the written shape stays short."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PROGRAM = """
import json, sys
from collections import Counter
from pathlib import Path
import wildshape
from wildshape.cli.main import main
root, visits = str(Path(wildshape.__file__).parent), Counter()

def visit(frame, event, _):
    code = frame.f_code
    ours = code.co_filename.startswith(root) and not code.co_name.startswith("<")
    if event == "call" and ours and code.co_flags & 1:  # no class bodies
        visits[f"{code.co_filename[len(root) + 1:]}:{code.co_name}"] += 1

sys.setprofile(visit)
main(sys.argv[1:])
sys.setprofile(None)
print("visits", json.dumps(visits))
"""
ROOMS = ("cli", "inference", "io", "records.py")
"""The mathematics (`geometry`, `method`, `ops`) is no part of the way."""


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> dict[str, int]:
    """How often each function ran, by `file:name`."""
    scan = Path(__file__).parents[2] / "examples" / "scan.npy"
    out = tmp_path_factory.mktemp("way") / "completed"
    words = (sys.executable, "-c", PROGRAM, "complete", str(scan), "--out", str(out))
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(np.load(scan)) > 16
    return json.loads(done.stdout.rpartition("visits ")[2])


def test_a_scan_visits_few_files(visits: dict[str, int]) -> None:
    files = {name.partition(":")[0] for name in visits}
    ours = {f for f in files if f.startswith(ROOMS) and not f.endswith("__init__.py")}
    assert len(ours) <= 20, sorted(ours)


def test_a_scan_is_checked_once(visits: dict[str, int]) -> None:
    checks = ("io/scans/points.py:check_scan", "inference/point_inputs.py:as_points")
    assert sum(visits.get(name, 0) for name in checks) == 1
