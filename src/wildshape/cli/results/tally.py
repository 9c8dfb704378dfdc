# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `complete` and `register` count while they work, and what is not to be trusted of it."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from wildshape.cli.terminal import counted
from wildshape.records import Completion, Registration, Track


def doubt(done: Completion | Registration) -> str:
    """A sentence on one result that is not to be trusted, or nothing."""
    if not done.reasons:
        return ""
    why = ", ".join(map(_plain, done.reasons))
    detail = f" ({done.warning})" if done.warning else ""
    return f"this result is not to be trusted: {why}{detail}"


@dataclass
class Doubts:
    """Results that are not to be trusted, and why (`inference/reasons.py`).

    Attributes:
        seen: results looked at.
        flagged: of them not to be trusted; `example` is the first, with its warning if any.
        reasons: how often each speaks.
    """

    seen: int = 0
    flagged: int = 0
    example: str = ""
    reasons: Counter[str] = field(default_factory=Counter)

    def add(self, name: str, done: Completion) -> None:
        """Look at a result."""
        self.seen += 1
        self.flagged += bool(done.reasons)
        self.reasons.update(done.reasons)
        if done.reasons and not self.example:
            self.example = f"{name}: {done.warning}" if done.warning else name

    def of(self, names: Iterable[str], done: Iterable[Completion]) -> "Doubts":
        """The same with more results looked at."""
        for name, one in zip(names, done, strict=True):
            self.add(name, one)
        return self

    @property
    def sentence(self) -> str:
        """How many are not to be trusted and the commonest reasons, or nothing."""
        if not self.flagged:
            return ""
        why = ", ".join(f"{_plain(reason)} {n}" for reason, n in self.reasons.most_common())
        are = "is" if self.flagged == 1 else "are"
        return (
            f"{self.flagged} of {counted(self.seen, 'result')} {are} not to be trusted: {why};"
            f" for example {self.example}"
        )

    @property
    def data(self) -> dict[str, Any]:
        """The same for machines, the commonest reason first."""
        return {"flagged": self.flagged, "reasons": dict(self.reasons.most_common())}


def _plain(reason: str) -> str:
    return reason.replace("_", " ")


@dataclass
class Tally:
    """What was done.

    Attributes:
        tracks: written now.
        kept: finished by an earlier, interrupted run.
        scans: written now.
        skipped: what could not be used, with the reason.
        doubts: which scans' results are not to be trusted.
    """

    tracks: int = 0
    kept: int = 0
    scans: int = 0
    skipped: list[tuple[str, str]] = field(default_factory=list)
    doubts: Doubts = field(default_factory=Doubts)

    def add(self, track: Track, scans: list[Completion]) -> None:
        """Count a track."""
        self.tracks += 1
        self.scans += len(scans)
        self.doubts.of((f"{track.name}/{name}" for name in track.scan_names), scans)
