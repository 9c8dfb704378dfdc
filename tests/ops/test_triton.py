# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The GPU kernels, run on the CPU by Triton's interpreter in a process of its own."""

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

PROGRAM = """
import torch
from wildshape.ops.nearest.nearest_torch import nearest_reference
from wildshape.ops.nearest.nearest_triton import nearest_triton
from wildshape.ops.zbuffer.zbuffer_torch import visible_reference
from wildshape.ops.zbuffer.zbuffer_triton import visible_triton

random = torch.Generator().manual_seed(0)
for B, N, M in [(1, 1, 1), (2, 3, 33), (2, 70, 65), (0, 3, 3), (2, 0, 3), (2, 3, 0)]:
    for grid in (False, True):
        make = (lambda n: torch.randint(0, 3, (B, n, 3), generator=random).float()) if grid else (
            lambda n: torch.randn(B, n, 3, generator=random))
        query, target = make(N), make(M)
        found, exact = nearest_triton(query, target), nearest_reference(query, target)
        assert torch.equal(found.index, exact.index), (B, N, M, grid)
        torch.testing.assert_close(found.distance_squared, exact.distance_squared)
query, target = torch.randn(4, 20, 3, generator=random), torch.randn(4, 40, 3, generator=random)
sizes = torch.tensor([20, 0, 7, 3]), torch.tensor([1, 40, 0, 33])
found = nearest_triton(query, target, *sizes)
exact = nearest_reference(query, target, *sizes)
assert torch.equal(found.index, exact.index)
torch.testing.assert_close(found.distance_squared, exact.distance_squared)
for N, n_bins in [(1, 1), (300, 50), (40, 1000), (0, 5)]:
    bins = torch.randint(-2, n_bins + 2, (3, N), generator=random)
    depth = torch.randint(-2, 4, (3, N), generator=random).float()
    assert torch.equal(visible_triton(bins, depth, n_bins), visible_reference(bins, depth, n_bins))
"""


@pytest.mark.skipif(not find_spec("triton"), reason="triton is not installed")
def test_kernels_equal_the_reference_under_the_interpreter():
    environment = os.environ | {"TRITON_INTERPRET": "1"}
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert result.returncode == 0, result.stderr
