# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How long each stage of a drive takes, and who is told of its progress."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Watch = Callable[[str, int, int], None]
"""Told the stage, how much of it is done, and how much there is."""


def silent(stage: str, done: int, total: int) -> None:
    """Nobody is told."""
    del stage, done, total


@dataclass
class Clock:
    """Seconds by stage, and who is told of progress; `prefix` goes before the stages' names."""

    watch: Watch
    prefix: str = ""
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Callable[[int], None]]:
        """Time a stage; gives what tells how much of it is done."""
        name = f"{self.prefix}{name}"
        began = time.perf_counter()
        yield lambda done: self.watch(name, done, total)
        self.seconds[name] = round(time.perf_counter() - began, 3)
