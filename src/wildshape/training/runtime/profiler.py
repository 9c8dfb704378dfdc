# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a step's time goes: a few steps under torch's profiler, written as one small table.

The stages are labelled where they happen, by `record_function("wildshape: ...")`, which costs a
microsecond or two while nothing is recorded.
"""

import os
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch._C._autograd import DeviceType
from torch.profiler import ProfilerActivity, profile, schedule

from wildshape.io.atomic import write_text

PROFILE = "profile.txt"
_SKIPPED, _WARM_UP, _RECORDED, _SLOWEST = 2, 1, 20, 12
_LABEL = "wildshape: "
_IN_STEP = ("headings", "sampling", "forward", "backward", "optimiser")
_IN_FORWARD = (
    "encoder scoring",
    "encoder winners",
    "encoder static",
    "encoder dense",
    "heads",
    "search",
    "z-buffer",
)


@contextmanager
def steps_profiled(path: Path | None) -> Iterator[Callable[[], None]]:
    """Yields what is to be called after every step; steps 4 to 23 go into the file.

    A run that ends earlier writes what it has; one of fewer than four steps says so.

    Args:
        path: file to write; None profiles nothing.
    """
    if path is None:
        yield lambda: None
        return
    write_text(
        path, f"no step profiled: a run of {_SKIPPED + _WARM_UP + 1} steps or more is needed\n"
    )
    os.environ.setdefault("KINETO_LOG_LEVEL", "99")  # it would announce itself on stderr
    activities = [ProfilerActivity.CPU]
    if torch.cuda.is_available():
        activities.append(ProfilerActivity.CUDA)
    with profile(
        activities=activities,
        schedule=schedule(skip_first=_SKIPPED, wait=0, warmup=_WARM_UP, active=_RECORDED, repeat=1),
        on_trace_ready=lambda done: _write(done, path),
        acc_events=True,
    ) as running:
        yield running.step


def _write(done: profile, path: Path) -> None:
    on_cpu = [e for e in done.events() or () if e.device_type == DeviceType.CPU]
    in_step = _within(on_cpu, "step")
    if in_step:
        write_text(path, report(in_step))


def _within(events: list[Any], stage: str) -> list[Any]:
    """Events that begin and end while a stage runs, itself among them: no validation."""
    spans = sorted(
        (e.time_range.start, e.time_range.end) for e in events if e.name == _LABEL + stage
    )
    starts = [start for start, _ in spans]
    kept = []
    for event in events:
        at = bisect_right(starts, event.time_range.start) - 1
        if at >= 0 and event.time_range.end <= spans[at][1]:
            kept.append(event)
    return kept


def report(events: list[Any]) -> str:
    """The table, from the events of whole steps; `device` times are those of kernels launched."""
    steps = sum(event.name == f"{_LABEL}step" for event in events)
    fields = ["cpu_time_total"]
    if any(event.self_device_time_total > 0 for event in events):
        fields.append("device_time_total")
    tables = [_stages(events, field, steps) for field in fields]
    lines = [f"{steps} steps, {torch.get_num_threads()} threads; milliseconds a step and share"]
    lines.append(f"{'stage':<26}{'CPU':>10}" + f"{'':>8}{'GPU':>10}" * (len(fields) - 1))
    for name in tables[0]:
        cells = (f"{t[name]:>10.3f}{_percent(t[name], t['step']):>8}" for t in tables)
        lines.append(f"{name:<26}" + "".join(cells))
    return "\n".join([*lines, "", *_slowest(events, f"self_{fields[-1]}", steps)]) + "\n"


def _stages(events: list[Any], field: str, steps: int) -> dict[str, float]:
    """Milliseconds a step of each stage; those within the forward pass only from there."""
    found: dict[str, float] = defaultdict(float)
    forward = {id(event) for event in _within(events, "forward")}
    for event in events:
        name = event.name.removeprefix(_LABEL)
        if name in ("step", *_IN_STEP) or (name in _IN_FORWARD and id(event) in forward):
            found[name] += getattr(event, field) / 1e3 / steps
    return _with_rests(found)


def _with_rests(found: dict[str, float]) -> dict[str, float]:
    """Stages in the order of a step, with what no label covers, indented under their parents."""
    inside = {f"  {name}": found[name] for name in _IN_FORWARD if name in found}
    table = {name: found[name] for name in _IN_STEP if name in found}
    rest = {"  loss and the rest": table["forward"] - sum(inside.values())}
    other = {"rest of the step": found["step"] - sum(table.values())}
    after = {name: table.pop(name) for name in ("backward", "optimiser")}
    return table | inside | rest | after | other | {"step": found["step"]}


def _slowest(events: list[Any], field: str, steps: int) -> list[str]:
    """The operations that take most time by themselves."""
    own: dict[str, float] = defaultdict(float)
    calls = Counter(event.name for event in events)
    for event in events:
        own[event.name] += getattr(event, field) / 1e3 / steps
    operations = [name for name in own if not name.startswith(_LABEL)]
    first = sorted(operations, key=lambda name: -own[name])[:_SLOWEST]
    head = f"{'slowest operations, own time':<46}{'ms':>10}{'calls':>9}"
    return [head, *(f"{k[:45]:<46}{own[k]:>10.3f}{calls[k] / steps:>9.1f}" for k in first)]


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole > 0 else ""
