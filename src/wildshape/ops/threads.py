# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Threads for work whose result is the same on any number of them.

A sum of torch's depends on how many threads share it. Searches and single scans do not.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from typing import TypeVar

import torch

Item = TypeVar("Item")
Result = TypeVar("Result")

_given: int | None = None


def exact_threads() -> int:
    """How many threads such work runs on: as many as torch, unless `exact_on` says otherwise."""
    return torch.get_num_threads() if _given is None else _given


@contextmanager
def exact_on(count: int) -> Iterator[None]:
    """Such work runs on so many threads, however few torch has: its sums may be kept to one."""
    global _given
    before, _given = _given, count
    try:
        yield
    finally:
        _given = before


def alone(count: int) -> ThreadPoolExecutor:
    """So many threads, in each of which torch works alone."""
    return ThreadPoolExecutor(count, initializer=_work_alone)


def _work_alone() -> None:
    """A thread takes over torch's number when it first asks for it: later it would ask again."""
    torch.get_num_threads()
    torch.set_num_threads(1)


def spread(task: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`task(item)` of all items, in order; this thread works, too.

    Args:
        task: spends its time where Python lets other threads run; its result depends on the item
            alone. It spreads nothing itself.
        items: what it works on.
    """
    listed = list(items)
    count = min(exact_threads(), len(listed))
    if count < 2:
        return [task(item) for item in listed]
    found, numbers = dict[int, Result](), iter(range(len(listed)))

    def work() -> None:
        for number in numbers:  # each thread takes the next
            found[number] = task(listed[number])

    others = [_kept(count - 1).submit(work) for _ in range(count - 1)]
    try:
        with _torch_alone():
            work()
    finally:
        wait(others)
    for other in others:
        other.result()
    return [found[number] for number in range(len(listed))]


@cache
def _kept(count: int) -> ThreadPoolExecutor:
    """Threads that stay: each keeps memory of its own, which new ones would have to get first."""
    return alone(count)


@contextmanager
def _torch_alone() -> Iterator[None]:
    """In this thread torch works alone."""
    before = torch.get_num_threads()
    if before > 1:
        torch.set_num_threads(1)
    try:
        yield
    finally:
        if before > 1:
            torch.set_num_threads(before)
