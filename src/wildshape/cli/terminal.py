# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The terminal of a command: what is said on it, and the signals that stop the work.

Results go to stdout, everything else to stderr. Ctrl-C and SIGTERM act at once where work is
atomic, between two steps where it is not.
"""

import json
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

from wildshape.io.progress import Bar, counted, duration, printable

if TYPE_CHECKING:
    from wildshape.inference.folders.complete_folder import FolderSummary

Handler = Callable[[int, FrameType | None], None]

_EVERY_SECONDS = 10.0
_MOMENT_S = 0.05
_ALARM = (signal.SIGALRM,) if hasattr(signal, "setitimer") else ()  # Windows has none
_IMPORTER = "<frozen importlib._bootstrap>"
_LISTED = 20


def say(text: str) -> None:
    """A message for people."""
    print(printable(text), file=sys.stderr, flush=True)


def answer(text: str, data: Mapping[str, Any], *, as_json: bool) -> None:
    """The result of a command: a text, or with `--json` one JSON object, null for NaN."""
    said = json.dumps(_finite(data), allow_nan=False) if as_json else text
    code = sys.stdout.encoding or "utf-8"
    print(said.encode(code, "backslashreplace").decode(code), flush=True)


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


def conclude(found: "FolderSummary", *, as_json: bool) -> None:
    """What `complete` and `register` say of a folder."""
    for told in found.doubts:
        say(told)
    say_skipped(found.skipped)
    if found.reasons.flagged:
        say(found.reasons.sentence)
    answer(_sentence(found), _data(found), as_json=as_json)


def _sentence(found: "FolderSummary") -> str:
    earlier = counted(found.finished_before, "track")
    before = f", {earlier} had been finished before" if found.finished_before else ""
    return (
        f"{found.done} {counted(found.scans, 'scan')} of {counted(found.tracks, 'track')}"
        f" in {duration(found.seconds)} with {counted(found.workers, 'worker')}{before};"
        f" see {found.out}"
    )


def _data(found: "FolderSummary") -> dict[str, Any]:
    return {
        "out": str(found.out),
        "tracks": found.tracks,
        "tracks_finished_before": found.finished_before,
        "scans": found.scans,
        "skipped": [{"what": what, "reason": reason} for what, reason in found.skipped],
        **found.reasons.data,
        "workers": found.workers,
        "seconds": round(found.seconds, 3),
    }


class Terminal:
    """Progress on stderr."""

    def say(self, text: str) -> None:
        """See `say`."""
        say(text)

    def skipped(self, skipped: Sequence[tuple[str, str]]) -> None:
        """See `say_skipped`."""
        say_skipped(skipped)

    @contextmanager
    def bar(self, label: str, total: int, *, start: int = 0) -> Iterator[Bar]:
        """A bar with the time left on a terminal, else a line every ten seconds."""
        if sys.stderr.isatty():
            with _rich_bar(label, total, start) as drawn:
                yield drawn
        else:
            yield _Lines(label, total, start)


TERMINAL = Terminal()


@contextmanager
def stage_bars(first: str = "") -> Iterator[Callable[[str, int, int], None]]:
    """A bar of progress a stage, told by its name, what is done, and the total.

    `first` is said before the first: after all that is refused before any work.
    """
    with ExitStack() as stack:
        bars: dict[str, Bar] = {}

        def watch(stage: str, done: int, total: int) -> None:
            if not bars and first:
                say(first)
            if stage not in bars:
                stack.pop_all().close()
                bars[stage] = stack.enter_context(TERMINAL.bar(stage, total))
            bars[stage].at(done)

        yield watch


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


class Terminated(KeyboardInterrupt):
    """SIGTERM, handled like Ctrl-C but with its own exit code."""


class StopFlag:
    """Set by the first signal; a second one interrupts at once."""

    def __init__(self) -> None:
        self.signal: int | None = None

    def __call__(self) -> bool:
        """Whether a signal came."""
        return self.signal is not None

    def receive(self, number: int, frame: FrameType | None) -> None:
        """The signal handler."""
        if self.signal is not None:
            _raise(number, frame)
        self.signal = number

    def error(self, sentence: str) -> KeyboardInterrupt:
        """What to raise once the work has been put away."""
        return (Terminated if self.signal == signal.SIGTERM else KeyboardInterrupt)(sentence)


@contextmanager
def terminable() -> Iterator[None]:
    """Inside, SIGTERM raises `Terminated` as Ctrl-C raises KeyboardInterrupt.

    A library that the signal met in its native code may raise an error of its own instead. Left
    alone it would blame a sound file: whatever is raised after a signal leaves as the signal.
    An import is waited for: inside one torch's native code aborts, and Python may drop what is
    raised.
    """
    signals = _Signals()
    with _handled(signals.receive, signal.SIGINT, signal.SIGTERM, *_ALARM):
        try:
            yield
            if signals.waiting:
                signals.leave()
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException:  # a panic of native code is no Exception
            signals.leave()
            raise
        finally:
            if signals.waiting:
                signal.setitimer(signal.ITIMER_REAL, 0)


class _Signals:
    """Those that came; the last may wait for the end of an import."""

    def __init__(self) -> None:
        self.came: list[int] = []
        self.waiting = False

    def receive(self, number: int, frame: FrameType | None) -> None:
        """The signal handler; an alarm is of what waits."""
        if number not in _ALARM:
            self.came.append(number)
        self.waiting = bool(_ALARM) and _imports(frame)
        if self.waiting:
            signal.setitimer(signal.ITIMER_REAL, _MOMENT_S)
        else:
            self.leave()

    def leave(self) -> None:
        """Raise what came last, if anything did."""
        if self.came:
            _raise(self.came[-1], None)


def _imports(frame: FrameType | None) -> bool:
    while frame is not None and frame.f_code.co_filename != _IMPORTER:
        frame = frame.f_back
    return frame is not None


@contextmanager
def stop_flag() -> Iterator[StopFlag]:
    """Inside, Ctrl-C and SIGTERM set a flag that is looked at between two steps."""
    flag = StopFlag()
    with _handled(flag.receive, signal.SIGINT, signal.SIGTERM):
        yield flag


@contextmanager
def stoppable() -> Iterator[StopFlag]:
    """`stop_flag` for a training; its `StopRequested` ends the command as the signal does."""
    from wildshape.training.loop import StopRequested

    with stop_flag() as flag:
        try:
            yield flag
        except StopRequested as stop:
            raise flag.error(str(stop)) from None


def _raise(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
    raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def _handled(handler: Handler, *numbers: signal.Signals) -> Iterator[None]:
    """Signals can be handled in the main thread only; elsewhere nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
