# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The benchmark of the GPU, without one: it says so, and its lines run on a CPU."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "bench_gpu.py"


def output(*arguments):
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *arguments],
        env=os.environ | {"OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_without_a_gpu_it_says_so():
    assert output() == "No GPU here: bench_gpu.py measures nothing.\n"


def test_every_path_of_it_runs_on_a_cpu(tmp_path):
    printed = output("--smoke", "--out", str(tmp_path))
    for name in ("captured", "eager", "plain", "2 side by side", "ours", "cdist", "complete_many"):
        assert f"\n{name} " in printed, name
    assert "operations that are no views, a step" in printed
    agreed = [line for line in printed.splitlines() if "losses of 6 steps off by" in line]
    assert len(agreed) == 2
    assert all(line.endswith(" met") for line in agreed)
    assert {p.suffix for p in tmp_path.iterdir()} == {".csv", ".json", ".svg"}
