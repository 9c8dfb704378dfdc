# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Who is told how long work goes on: a terminal, a log, or nobody."""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol, runtime_checkable


@runtime_checkable
class Bar(Protocol):
    """Progress of one long piece of work."""

    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        """So much is done; `text` says what else there is to say, `total` a new total."""
        ...


@runtime_checkable
class Progress(Protocol):
    """Is told by the library what goes on; the command line prints it."""

    def say(self, text: str) -> None:
        """A sentence that a user should know."""
        ...

    def skipped(self, skipped: Sequence[tuple[str, str]]) -> None:
        """What was left out, each with its reason."""
        ...

    def bar(self, label: str, total: int, *, start: int = 0) -> AbstractContextManager[Bar]:
        """A long piece of work begins.

        Args:
            label: what is done.
            total: how much of it there is; 0 if nobody knows.
            start: how much had been done before.
        """
        ...


class Silent:
    """Tells nobody."""

    def say(self, text: str) -> None:
        """Nothing."""

    def skipped(self, skipped: Sequence[tuple[str, str]]) -> None:
        """Nothing."""

    @contextmanager
    def bar(self, label: str, total: int, *, start: int = 0) -> Iterator[Bar]:  # noqa: ARG002
        """Nothing."""
        yield self

    def at(self, done: int, text: str = "", *, total: int | None = None) -> None:
        """Nothing."""


SILENT = Silent()


def counted(count: int, what: str) -> str:
    """For example `1 scan`, `2 scans`, `20,000 scans`."""
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def duration(seconds: float) -> str:
    """For example `42 s`, `3 min 05 s`, `2 h 10 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def printable(text: str) -> str:
    """Text without control characters, which a damaged file could send to the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)


def literal(text: str) -> str:
    """Text that matplotlib draws as it is: no formulas, no control characters."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return shown.replace("$", r"\$")
