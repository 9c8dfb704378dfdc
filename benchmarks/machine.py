# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every benchmark says of itself: hardware, versions, commit; and memory, medians, bars."""

from pathlib import Path
from statistics import median, quantiles
from typing import Literal

import torch

from wildshape.io.output import provenance
from wildshape.ops.nearest import backend

Kind = Literal["exact", "measured", "clock"]
"""What a bar is about: a value that any machine gives at any size; what a whole run finds, such as
a ratio of times taken by turns; or a time by the clock, which is that of one quiet machine."""

MISSED, MISSED_HERE = "MISSED", "MISSED by this machine"
_state = {"speed is judged": True}


def header(command: str) -> str:
    """One line: where these numbers come from."""
    made = provenance(command)
    hardware = made["hardware"]
    gpu = f", {hardware['gpu']}" if hardware["gpu"] else ""
    return (
        f"{hardware['cpu']}, {hardware['cores']} cores{gpu}; {torch.get_num_threads()} threads;"
        f" torch {made['torch']}, python {made['python']}; commit {made['code'][:12]}"
        f"{' with changes' if made['code'].endswith('changes') else ''};"
        f" nearest neighbours: {backend()}; {made['time_utc']}"
    )


def peak_mib() -> float:
    """Most memory that this process has held, MiB; NaN where the system does not say."""
    status = Path("/proc/self/status")
    if not status.exists():
        return float("nan")
    line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def p95(values: list[float]) -> float:
    return quantiles(values, n=20, method="inclusive")[-1] if len(values) > 1 else values[0]


def judge_speed(*, wanted: bool) -> None:
    """Whether bars other than the exact ones are judged: not where nothing is measured."""
    _state["speed is judged"] = wanted


def verdict(
    name: str, value: float, bar: float, *, least: bool = False, kind: Kind = "exact"
) -> str:
    """Whether a bar is met: `value` at most `bar`, or at least."""
    met = value >= bar if least else value <= bar
    said = "met" if met else MISSED_HERE if kind == "clock" else MISSED
    if kind != "exact" and not _state["speed is judged"]:
        said = "not judged at this size"
    return f"bar: {name} {'>=' if least else '<='} {bar:g}: {value:.3g} {said}"


__all__ = [
    "MISSED",
    "MISSED_HERE",
    "Kind",
    "header",
    "judge_speed",
    "median",
    "p95",
    "peak_mib",
    "verdict",
]
