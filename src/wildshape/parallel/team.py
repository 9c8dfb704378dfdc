# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Who does the work: every core of this machine, or a Ray cluster."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar, runtime_checkable

from wildshape.errors import BadInputError
from wildshape.parallel.processes import Processes
from wildshape.parallel.ray_cluster import on_ray

Item = TypeVar("Item")
Result = TypeVar("Result")


@runtime_checkable
class Team(Protocol):
    """What does a task on items; no result depends on who worked on what (`Processes`)."""

    @property
    def size(self) -> int:
        """How many work at most."""
        ...

    @property
    def worked(self) -> int:
        """How many have worked until now."""
        ...

    def in_order(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """`task(item)` of all items, in order."""
        ...

    def as_done(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """The same in the order in which the work ends."""
        ...


ALONE: Team = Processes(1)
"""This process."""


@contextmanager
def team(
    workers: int | Team | None = None, ray: str | None = None, soon: str | None = None
) -> Iterator[Team]:
    """The processes of this machine, or a cluster's; the end of the block ends them.

    Args:
        workers: how many; None: one a core; or those of a block around this one, which ends them.
        ray: address of a Ray cluster in place of this machine (`on_ray`).
        soon: a module that long work will need; a helper of this machine imports it at once.

    Raises:
        BadInputError: fewer than one worker; no cluster answers there.
        MissingExtraError: Ray is not installed.
    """
    if workers is not None and not isinstance(workers, int):
        if soon is not None and isinstance(workers, Processes):
            workers.begin(soon)
        yield workers
        return
    if workers is not None and workers < 1:
        raise BadInputError(f"--workers {workers}: expected 1 or more.")
    if ray is not None:
        with on_ray(ray, workers) as cluster:
            yield cluster
        return
    found = Processes(cores() if workers is None else workers)
    if soon is not None:
        found.begin(soon)
    try:
        yield found
    finally:
        found.close()


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
