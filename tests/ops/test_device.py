# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Memory kept between steps: on glibc the setting is accepted, elsewhere it is a no-op."""

import platform
import subprocess
import sys

from wildshape.ops import device as allocator

PROGRAM = "from wildshape.ops.device import keep_memory; print(keep_memory())"


def test_takes_effect_on_glibc():
    made = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert made.stdout.strip() == str(platform.libc_ver()[0] == "glibc")


def test_does_nothing_on_other_libraries(monkeypatch):
    monkeypatch.setattr(platform, "libc_ver", lambda: ("musl", "1.2"))
    assert not allocator.keep_memory()
