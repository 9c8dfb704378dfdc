# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the commands say: results on stdout, everything else on stderr."""

import json
import math
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from wildshape.report.words import counted as counted

_EVERY_SECONDS = 10.0
_LISTED = 20


def say(text: str) -> None:
    """A message for people."""
    print(printable(text), file=sys.stderr, flush=True)


def printable(text: str) -> str:
    """Text without control characters, which a damaged file could send to the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def answer(text: str, data: Mapping[str, Any], *, as_json: bool) -> None:
    """The result of a command: a text, or with `--json` one JSON object, null for NaN."""
    said = json.dumps(_finite(data), allow_nan=False) if as_json else text
    print(said.encode("utf-8", "backslashreplace").decode(), flush=True)


def _finite(data: Any) -> Any:
    """JSON knows neither NaN nor infinity, and most readers stop there."""
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def say_skipped(skipped: Sequence[tuple[str, str]]) -> None:
    """List what was left out and why."""
    if not skipped:
        return
    say(f"skipped {len(skipped)}:")
    for what, reason in skipped[:_LISTED]:
        say(f"  {what}: {reason}")
    if len(skipped) > _LISTED:
        say(f"  and {len(skipped) - _LISTED} more, all of them in wildshape.json")


def duration(seconds: float) -> str:
    """For example `42 s`, `3 min 05 s`, `2 h 10 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class Bar(Protocol):
    """Progress of one long piece of work."""

    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        """So much is done; `text` says what else there is to say, `total` a new total."""
        ...


@contextmanager
def progress(label: str, total: int, *, silent: bool = False, start: int = 0) -> Iterator[Bar]:
    """A bar with the time left on a terminal, else a line every ten seconds; on stderr.

    Args:
        label: what is done.
        total: how much of it there is; 0 if nobody knows.
        silent: show nothing at all (processes that do not lead).
        start: how much had been done before.
    """
    if silent:
        yield _Nothing()
    elif sys.stderr.isatty():
        with _rich_bar(label, total, start) as bar:
            yield bar
    else:
        yield _Lines(label, total, start)


class _Nothing:
    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        pass


class _Lines:
    """Plain lines, for logs."""

    def __init__(self, label: str, total: int, start: int) -> None:
        self.label, self.total, self.start = label, total, start
        self.began = self.spoke = time.monotonic()

    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        now = time.monotonic()
        self.total = self.total if total is None else total
        if done != self.total and now - self.spoke < _EVERY_SECONDS:
            return
        self.spoke = now
        of = f"/{self.total}" if self.total else ""
        parts = [f"{self.label}: {done}{of}", text]
        if self.start < done < self.total:
            left = (now - self.began) / (done - self.start) * (self.total - done)
            parts.append(f"{duration(left)} left")
        say(", ".join(part for part in parts if part))


class _RichBar:
    def __init__(self, bars: Any, task: Any) -> None:
        self.bars, self.task = bars, task

    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        self.bars.update(self.task, completed=done, text=text, total=total)


@contextmanager
def _rich_bar(label: str, total: int, start: int) -> Iterator[_RichBar]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        yield _RichBar(bars, bars.add_task(label, total=total or None, completed=start, text=""))
