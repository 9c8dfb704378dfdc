# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Timing by turns: all methods of a comparison in one run, busy neighbours hit them alike."""

import argparse
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import torch

_MOST_IN_A_ROUND = 5


def options(doc: str | None) -> argparse.ArgumentParser:
    """The command line that all benchmarks share."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="the form that `make bench` runs")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    return parser


def take_turns(
    methods: Mapping[str, Callable[[], object]], seconds: float, at_least: int = 5
) -> dict[str, list[float]]:
    """Milliseconds of every call of each method, round by round after one to warm up.

    Fast methods are called several times a round, at most as long as the slowest one takes.
    """
    calls = _calls_a_round({name: timed(work) for name, work in methods.items()})
    found: dict[str, list[float]] = {name: [] for name in methods}
    end, rounds = time.perf_counter() + seconds, 0
    while rounds < at_least or time.perf_counter() < end:
        rounds += 1
        for name, work in methods.items():
            found[name] += [timed(work) for _ in range(calls[name])]
    return found


def _calls_a_round(first: dict[str, float]) -> dict[str, int]:
    slowest = max(first.values())
    return {name: max(1, min(_MOST_IN_A_ROUND, int(slowest / ms))) for name, ms in first.items()}


def timed(work: Callable[[], object]) -> float:
    """Milliseconds of one call."""
    began = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - began)
