# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a command asks of its process: to be stopped well, and to import torch quickly.

Ctrl-C and SIGTERM act at once where work is atomic, between two steps where it is not.
"""

import gc
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

Handler = Callable[[int, FrameType | None], None]


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
    """Inside, SIGTERM raises `Terminated` as Ctrl-C raises KeyboardInterrupt."""
    with _handled(_raise, signal.SIGTERM):
        yield


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


@contextmanager
def uncollected() -> Iterator[None]:
    """No collection of garbage inside: a fifth of a cold start.

    Modules live as long as the process, and torch's are many to walk.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
