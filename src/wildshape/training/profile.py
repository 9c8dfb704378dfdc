# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a step's time goes: a few steps under torch's profiler, written as one small table.

The stages are labelled where they happen, by `record_function("wildshape: ...")`, which costs a
microsecond or two while nothing is recorded.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch.profiler import ProfilerActivity, profile, schedule

PROFILE = "profile.txt"
_SKIPPED, _WARM_UP, _RECORDED, _SLOWEST = 2, 1, 20, 12
_LABEL = "wildshape: "
_IN_STEP = ("sampling", "forward", "backward", "optimiser")
_IN_FORWARD = ("encoder scoring", "encoder winners", "encoder dense", "heads", "search", "z-buffer")


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
    path.write_text(
        f"no step profiled: a run of {_SKIPPED + _WARM_UP + 1} steps or more is needed\n"
    )
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
    found = {event.key: event for event in done.key_averages()}
    if f"{_LABEL}step" in found:
        path.write_text(report(found))


def report(events: dict[str, Any]) -> str:
    """The table, from the profiler's averages by name."""
    gpu = any(event.self_device_time_total > 0 for event in events.values())
    stages = {key.removeprefix(_LABEL): e for key, e in events.items() if key.startswith(_LABEL)}
    steps = stages["step"].count
    columns = [{name: e.cpu_time_total / 1e3 / steps for name, e in stages.items()}]
    if gpu:
        columns.append({name: e.device_time_total / 1e3 / steps for name, e in stages.items()})
    tables = [_with_rests(column) for column in columns]
    lines = [f"{steps} steps, {torch.get_num_threads()} threads; milliseconds a step and share"]
    lines.append(f"{'stage':<26}{'CPU':>10}" + (f"{'':>8}{'GPU':>10}" if gpu else ""))
    for name in tables[0]:
        cells = (f"{t[name]:>10.3f}{_percent(t[name], t['step']):>8}" for t in tables)
        lines.append(f"{name:<26}" + "".join(cells))
    return "\n".join([*lines, "", *_slowest(events, steps, gpu)]) + "\n"


def _with_rests(found: dict[str, float]) -> dict[str, float]:
    """Stages in the order of a step, with what no label covers, indented under their parents."""
    inside = {f"  {name}": found[name] for name in _IN_FORWARD if name in found}
    table = {name: found.get(name, 0.0) for name in _IN_STEP}
    rest = {"  loss and the rest": table["forward"] - sum(inside.values())}
    other = {"rest of the step": found["step"] - sum(table.values())}
    front = {name: table.pop(name) for name in ("sampling", "forward")}
    return front | inside | rest | table | other | {"step": found["step"]}


def _slowest(events: dict[str, Any], steps: int, gpu: bool) -> list[str]:
    """The operations that take most time by themselves."""
    field = "self_device_time_total" if gpu else "self_cpu_time_total"
    plain = {
        k: getattr(e, field) / 1e3 / steps for k, e in events.items() if not k.startswith(_LABEL)
    }
    first = sorted(plain, key=lambda key: -plain[key])[:_SLOWEST]
    head = f"{'slowest operations, own':<46}{'ms':>10}{'calls':>9}"
    return [head, *(f"{k[:45]:<46}{plain[k]:>10.3f}{events[k].count / steps:>9.1f}" for k in first)]


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole > 0 else ""
