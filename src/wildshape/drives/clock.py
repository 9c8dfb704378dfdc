# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How long each stage of a drive takes, and who is told of its progress."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from wildshape.errors import BadInputError
from wildshape.io.atomic import write_json
from wildshape.io.guard import read_json, reading

_OFTEN_S = 1.0  # what a killed run loses of a long stage
_SAYS = "seconds of stages"

Watch = Callable[[str, int, int], None]
"""Told the stage, how much of it is done, and how much there is."""


def silent(stage: str, done: int, total: int) -> None:
    """Nobody is told."""
    del stage, done, total


@dataclass
class Clock:
    """Seconds by stage, and who is told of progress; `prefix` goes before the stages' names.

    They are kept in a file, if `path` names one: a run that goes on counts on from there.
    """

    watch: Watch
    prefix: str = ""
    seconds: dict[str, float] = field(default_factory=dict)
    path: Path | None = None

    def going_on(
        self, path: Path, prefix: str = "", before: Mapping[str, float] = MappingProxyType({})
    ) -> "Clock":
        """One that counts on from what an interrupted run kept, and from what was done `before`.

        Raises:
            BadInputError: the file is damaged.
        """
        kept = dict(before)
        if path.is_file():
            with reading(path, _SAYS):
                kept |= {name: float(spent) for name, spent in read_json(path, _SAYS).items()}
        return Clock(self.watch, prefix, kept, path)

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Callable[[int], None]]:
        """Time a stage; gives what tells how much of it is done."""
        name = f"{self.prefix}{name}"
        before = self.seconds.get(name, 0.0)
        began = written = time.perf_counter()

        def count() -> None:
            self.seconds[name] = round(before + time.perf_counter() - began, 3)
            if self.path is not None:
                write_json(self.path, self.seconds)

        def at(done: int) -> None:
            nonlocal written
            if time.perf_counter() > written + _OFTEN_S:
                count()
                written = time.perf_counter()
            self.watch(name, done, total)

        try:
            yield at
        except BadInputError:
            raise  # of what is refused nothing is kept
        except BaseException:
            count()
            raise
        count()
