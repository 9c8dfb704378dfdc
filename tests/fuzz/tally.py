# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What became of the inputs, by reader: the table, and the file a stopped run goes on from."""

import json
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.fuzz.judge import Verdict


@dataclass
class Row:
    """A reader's line of the table."""

    inputs: int = 0
    accepted: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    peak: int = 0
    failures: Counter[str] = field(default_factory=Counter)

    def count(self, verdict: Verdict) -> None:
        """Add an input."""
        self.inputs += 1
        self.accepted += verdict.accepted
        self.seconds += verdict.seconds
        self.slowest = max(self.slowest, verdict.seconds)
        self.peak = max(self.peak, verdict.peak)
        if verdict.failure:
            self.failures[verdict.failure] += 1

    def text(self, name: str) -> str:
        """The line."""
        mean = 1000 * self.seconds / max(self.inputs, 1)
        failed = ", ".join(f"{count} {kind}" for kind, count in self.failures.items())
        numbers = f"{self.inputs:8}{self.accepted:8}{self.inputs - self.accepted:8}{mean:9.1f}"
        return f"{name:18}{numbers}{1000 * self.slowest:9.0f}{self.peak / (1 << 20):9.0f}  {failed}"


_HEAD = f"{'reader':18}{'inputs':>8}{'read':>8}{'refused':>8}"
_HEAD += f"{'mean ms':>9}{'slowest':>9}{'peak MB':>9}  failures"


class Tally:
    """Rows of all readers, and which batches are done."""

    def __init__(self, names: Iterable[str], identity: list[Any], state: Path | None) -> None:
        """Go on from the state, if it is there.

        Args:
            names: of readers.
            identity: what a state must have in common with this run.
            state: the file, if any.
        """
        self.rows = {name: Row() for name in names}
        self.done: set[int] = set()
        self._identity, self._state = identity, state
        self._start = time.monotonic()
        if state is not None and state.exists():
            self._restore(json.loads(state.read_text()))

    @property
    def inputs(self) -> int:
        """Of all readers."""
        return sum(row.inputs for row in self.rows.values())

    @property
    def failures(self) -> int:
        """Of all readers."""
        return sum(row.failures.total() for row in self.rows.values())

    def save(self) -> None:
        """Keep the state."""
        if self._state is None:
            return
        rows = {name: vars(row) for name, row in self.rows.items()}
        part = self._state.with_suffix(".part")
        part.write_text(
            json.dumps({"run": self._identity, "done": sorted(self.done), "rows": rows})
        )
        part.replace(self._state)

    def line(self, planned: int) -> str:
        """How far it is."""
        spent = time.monotonic() - self._start
        return f"{self.inputs} of {planned} inputs, {self.failures} failures, {spent:.0f} s"

    def table(self) -> str:
        """All rows."""
        rows = [row.text(name) for name, row in self.rows.items()]
        return "\n".join([_HEAD, *rows, self.line(self.inputs)])

    def _restore(self, state: dict[str, Any]) -> None:
        if state["run"] != self._identity:
            raise SystemExit(f"{self._state}: of another run; name another file.")
        self.done = set(state["done"])
        for name, row in state["rows"].items():
            self.rows[name] = Row(**{**row, "failures": Counter(row["failures"])})
