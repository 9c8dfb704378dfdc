# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Memory kept between steps and for matrix products."""

import os
import platform
import subprocess
import sys

import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.ops import device as allocator

PROGRAM = "from wildshape.ops.device import keep_memory; print(keep_memory())"
PRODUCT = """
import resource, torch
from pathlib import Path
from wildshape.ops.device import choose_device
choose_device("cpu")
a, b = torch.randn(64, 512), torch.randn(512, 1024)
first, second = torch.zeros(2, 64, 1024)
pages = int(Path("/proc/self/statm").read_text().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize(), -1))
torch.mm(a, b, out=first)
resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
torch.mm(a, b, out=second)
print(torch.equal(first, second))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited as Linux does")
@pytest.mark.skipif(not torch.backends.mkl.is_available(), reason="this torch has no MKL")
def test_a_product_is_the_same_where_no_memory_is_left():
    alone = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PRODUCT], capture_output=True, text=True, env=alone
    )
    assert done.stdout.strip() == "True", done.stderr


def test_takes_effect_on_glibc():
    made = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert made.stdout.strip() == str(platform.libc_ver()[0] == "glibc")


def test_does_nothing_on_other_libraries(monkeypatch):
    monkeypatch.setattr(platform, "libc_ver", lambda: ("musl", "1.2"))
    assert not allocator.keep_memory()


@pytest.mark.parametrize("name", ["tpu", "meta", "mps", "None"])
def test_a_device_that_nothing_is_computed_on_is_refused(name):
    with pytest.raises(BadInputError, match=f"'{name}': there are cpu, cuda and auto"):
        allocator.choose_device(name)


def test_a_device_of_torch_is_taken():
    assert allocator.choose_device(torch.device("cpu")) == "cpu"
