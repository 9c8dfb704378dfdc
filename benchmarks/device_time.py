# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Times of work that a device does while the host runs ahead."""

import time
from collections.abc import Callable
from itertools import pairwise

import torch


def wait(device: str) -> None:
    if device == "cuda":
        torch.cuda.synchronize()


def laps(work: Callable[[], object], count: int, device: str) -> list[float]:
    """Milliseconds of each call, the host running ahead as it does in training."""
    if device != "cuda":
        moments = [time.perf_counter() * 1e3]
        for _ in range(count):
            work()
            moments.append(time.perf_counter() * 1e3)
        return [b - a for a, b in pairwise(moments)]
    events = [torch.cuda.Event(enable_timing=True) for _ in range(count + 1)]
    events[0].record()
    for event in events[1:]:
        work()
        event.record()
    torch.cuda.synchronize()
    return [a.elapsed_time(b) for a, b in pairwise(events)]
