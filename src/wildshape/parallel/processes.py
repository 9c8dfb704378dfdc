# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over this process and others beside it; what a killed one held is done again."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from wildshape.parallel.handout import Handout
from wildshape.parallel.helper import Helper, UnknownTaskError

Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 16
_WORTH_S = 1.0
"""Shorter work is done here: a helper needs as long to import what it needs."""


class Processes:
    """This process, and helpers where work takes longer than a second.

    Attributes:
        size: processes at most, this one included.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._assistants = [_Assistant() for _ in range(size - 1)]
        self._open: list[Handout[Any, Any]] = []

    @property
    def worked(self) -> int:
        """How many processes have done some of the work until now."""
        return 1 + sum(one.helped for one in self._assistants)

    def in_order(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """`task(item)` of all items, in order; few results are kept in memory.

        Args:
            task: works on an item anew where a helper died. One that does not come across to
                another process is done by this one alone.
            items: taken as they are needed; they and results can be pickled.

        Raises:
            BadInputError: helpers were killed again and again over one item.
            Exception: what the task raised.
        """
        return self._spread(task, Handout(items, ahead=_AHEAD * self.size))

    def as_done(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """As `in_order`, but in the order in which the work ends: a long item holds up no other."""
        return self._spread(task, Handout(items))

    def close(self) -> None:
        """End the helpers, whatever they are doing; nothing more is handed out."""
        for handout in self._open:
            handout.end()
        for one in self._assistants:
            one.close()

    def _spread(
        self, task: Callable[[Item], Result], handout: Handout[Item, Result]
    ) -> Iterator[Result]:
        self._open.append(handout)
        for one in self._assistants:
            one.assist(task, handout)
        threads = _Threads()
        try:
            while not handout.is_done():
                yield from handout.results()
                if any(one.ready for one in self._assistants):
                    threads.only_one()
                handout.do_one(task)
        finally:
            handout.end()
            self._open.remove(handout)
            threads.restore()


class _Assistant:
    """A thread that gives items to a helper.

    Python waits for it at its end: a thread that is cut off inside of torch aborts the process.

    Attributes:
        ready: the helper is at work, or waits for it.
        helped: it has done an item.
    """

    def __init__(self) -> None:
        self.ready = self.helped = False
        self._helper = Helper()
        self._jobs: SimpleQueue[tuple[Callable[[Any], Any], Handout[Any, Any]] | None] = (
            SimpleQueue()
        )
        self._thread = Thread(target=self._run)

    def assist(self, task: Callable[[Any], Any], handout: Handout[Any, Any]) -> None:
        """Help with this, once the work before is done."""
        if self._thread.ident is None:
            self._thread.start()
        self._jobs.put((task, handout))

    def close(self) -> None:
        """End the helper, and soon this thread: it may wait for an import of the caller's."""
        self._jobs.put(None)
        self._helper.close()

    def _run(self) -> None:
        for task, handout in iter(self._jobs.get, None):
            if not self.ready and handout.ends_within(_WORTH_S):
                continue
            with suppress(UnknownTaskError, OSError):  # then it is done without help
                self._helper.learn(task)
                self._serve(handout)

    def _serve(self, handout: Handout[Any, Any]) -> None:
        self.ready = True
        while (taken := handout.take()) is not None:
            number, item = taken
            try:
                handout.put(number, self._helper.work(item))
                self.helped = True
            except Exception as error:  # noqa: BLE001
                handout.fail(number, error)


class _Threads:
    """torch's threads in this process: they and helpers would take each other's cores."""

    def __init__(self) -> None:
        self._before = 0

    def only_one(self) -> None:
        """No more than this one from now on."""
        torch = sys.modules.get("torch")
        if torch is not None and not self._before:
            self._before = torch.get_num_threads()
            torch.set_num_threads(1)

    def restore(self) -> None:
        """As many as there were."""
        if self._before:
            sys.modules["torch"].set_num_threads(self._before)
