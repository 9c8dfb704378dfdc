# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Items that several threads take one by one, and their results."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from threading import Condition, Event
from typing import Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_MOMENT_S = 0.1


class Handout(Generic[Item, Result]):
    """Items are read when they are taken, each by one taker; results are collected by one thread.

    Args:
        items: read under a lock, in whatever thread takes the next.
        ahead: give results in the order of the items, and hand out so many more than were given
            at most; None: give them as they come.
    """

    def __init__(self, items: Iterable[Item], ahead: int | None = None) -> None:
        self._items = iter(items)
        self._ahead = ahead
        self._change = Condition()
        self._over = Event()
        self._results: dict[int, Future[Result]] = {}
        self._taken = self._given = 0

    def take(self, leaves: Callable[[], bool]) -> tuple[int, Item] | None:
        """The next item and its number, as soon as there is room.

        None where none is left, or to a taker that leaves (`wake`).
        """
        with self._change:
            self._change.wait_for(lambda: leaves() or self._over.is_set() or self._has_room())
            return None if leaves() else self._next()

    def wake(self) -> None:
        """Let takers see that they leave; one that reads an item meanwhile is not waited for."""
        if self._change.acquire(timeout=_MOMENT_S):
            self._change.notify_all()
            self._change.release()

    def put(self, number: int, result: Result) -> None:
        """The result of an item that was taken."""
        future: Future[Result] = Future()
        future.set_result(result)
        self._keep(number, future)

    def fail(self, number: int, error: Exception) -> None:
        """Why there is none; who collects the results is told."""
        future: Future[Result] = Future()
        future.set_exception(error)
        self._keep(number, future)

    def results(self) -> Iterator[Result]:
        """Those that are there.

        Raises:
            Exception: what an item, or the reading of one, failed with.
        """
        while (future := self._pop()) is not None:
            yield future.result()

    def do_one(self, task: Callable[[Item], Result]) -> None:
        """Work on an item in this thread, or wait for a result where there is none to take."""
        with self._change:
            taken = self._next()
            if taken is None:
                self._change.wait_for(lambda: self._ready() is not None or self.is_done())
                return
        number, item = taken
        self.put(number, task(item))

    def is_done(self) -> bool:
        """Whether all results were given."""
        with self._change:
            return self._over.is_set() and self._given == self._taken

    def ends_within(self, seconds: float) -> bool:
        """Wait so long at most; whether no item is left then."""
        return self._over.wait(seconds)

    def end(self) -> None:
        """Hand out nothing more."""
        with self._change:
            self._over.set()
            self._change.notify_all()

    def _next(self) -> tuple[int, Item] | None:
        if self._over.is_set() or not self._has_room():
            return None
        number = self._taken
        try:
            item = next(self._items)
        except StopIteration:
            self.end()
            return None
        except Exception as error:  # noqa: BLE001
            self._taken += 1
            self.fail(number, error)
            self.end()
            return None
        self._taken += 1
        return number, item

    def _has_room(self) -> bool:
        return self._ahead is None or self._taken - self._given < self._ahead

    def _keep(self, number: int, future: "Future[Result]") -> None:
        with self._change:
            self._results[number] = future
            self._change.notify_all()

    def _ready(self) -> int | None:
        """The number of a result that can be given."""
        number = next(iter(self._results), None) if self._ahead is None else self._given
        return number if number in self._results else None

    def _pop(self) -> "Future[Result] | None":
        with self._change:
            number = self._ready()
            if number is None:
                return None
            self._given += 1
            self._change.notify_all()
            return self._results.pop(number)
