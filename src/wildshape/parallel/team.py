# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Who does the work: every core of this machine, or a Ray cluster."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar, runtime_checkable

from wildshape.arguments import expect_whole
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
        BadInputError: no whole number of workers, or fewer than one; no cluster answers there.
        MissingExtraError: Ray is not installed.
    """
    if isinstance(workers, Team):
        if soon is not None and isinstance(workers, Processes):
            workers.begin(soon)
        yield workers
        return
    check_workers(workers)
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


def check_workers(workers: int | Team | None) -> None:
    """Refuse what is no number of processes, before any work.

    Raises:
        BadInputError: see `team`.
    """
    if workers is None or isinstance(workers, Team):
        return
    if expect_whole(workers, "workers", least=-sys.maxsize) < 1:
        raise BadInputError(f"--workers {workers}: expected 1 or more.")


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
