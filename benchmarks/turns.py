# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Timing by turns: all methods of a comparison in one run, busy neighbours hit them alike."""

import argparse
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import torch
from machine import judge_speed

_MOST_IN_A_ROUND = 5
_state: dict[str, Callable[[], float]] = {"clock": time.perf_counter}
_once = {"wanted": False}


def options(doc: str | None) -> argparse.ArgumentParser:
    """The command line that all benchmarks share."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--small", action="store_true", help="the form that `make bench` runs")
    parser.add_argument(
        "--smoke", action="store_true", help="seconds: whether it runs and agrees, not how fast"
    )
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument(
        "--cpu-time", action="store_true", help="where others use the machine too; one thread"
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    return parser


def begin(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Read the command line and set threads, clock and size by it; `smoke` is `small`, too."""
    arguments = parser.parse_args()
    arguments.small |= arguments.smoke
    _once["wanted"] = arguments.smoke
    judge_speed(wanted=not arguments.smoke)
    if arguments.cpu_time:
        arguments.threads = 1
    torch.set_num_threads(arguments.threads)
    # Competitors with an OpenMP runtime of their own are imported after this.
    os.environ["OMP_NUM_THREADS"] = str(arguments.threads)
    set_clock(cpu=arguments.cpu_time)
    return arguments


def set_clock(*, cpu: bool) -> None:
    """Time by this process's own CPU seconds, all its threads together, or by the wall's."""
    _state["clock"] = time.process_time if cpu else time.perf_counter


def clock_name() -> str:
    return "CPU time" if _state["clock"] is time.process_time else "wall clock"


def now() -> float:
    """Seconds on the clock that is set."""
    return _state["clock"]()


def take_turns(
    methods: Mapping[str, Callable[[], object]], seconds: float, at_least: int = 5
) -> dict[str, list[float]]:
    """Milliseconds of every call of each method, round by round after one to warm up.

    Fast methods are called several times a round, at most as long as the slowest one takes. In the
    smoke form each is called once.
    """
    if _once["wanted"]:
        return {name: [timed(work)] for name, work in methods.items()}
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
    began = now()
    work()
    return 1e3 * (now() - began)
