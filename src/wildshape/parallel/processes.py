# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over this process and others beside it; what a killed one held is done again."""

import atexit
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from importlib import import_module
from queue import SimpleQueue
from threading import Thread
from typing import Any, TypeVar

from wildshape.parallel.handout import Handout
from wildshape.parallel.helper import Helper, UnknownTaskError

Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 16
_PATIENCE_S = 10.0  # at the end of Python, for threads that read an item
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

    @property
    def worked(self) -> int:
        """How many processes have done some of the work until now."""
        return 1 + sum(one.helped for one in self._assistants)

    def begin(self, module: str) -> None:
        """Start the first helper for work that may be long: it imports the module of its tasks.

        The others follow once it is seen to be long.
        """
        for one in self._assistants[:1]:
            one.assist(_Importing(module), None)

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
        """End the helpers, whatever they are doing."""
        for one in self._assistants:
            one.close()

    def _spread(
        self, task: Callable[[Item], Result], handout: Handout[Item, Result]
    ) -> Iterator[Result]:
        for one in self._assistants:
            one.assist(task, handout)
        threads = _Threads()
        try:
            while not handout.is_done():
                yield from handout.results()
                threads.settle(alone=not any(one.ready for one in self._assistants))
                handout.do_one(task)
        finally:
            handout.end()
            threads.restore()


class _Importing:
    """In place of a task: a helper that takes it has imported a module."""

    def __init__(self, module: str) -> None:
        self._module = module

    def __reduce__(self) -> tuple[Callable[[str], Any], tuple[str]]:
        return import_module, (self._module,)

    def __call__(self, item: Any) -> None:
        """Nothing: there are no items."""


_Job = tuple[Callable[[Any], Any], Handout[Any, Any] | None]


class _Assistant:
    """A thread that gives items to a helper, until `close`, or until Python ends (`_end_all`).

    Attributes:
        ready: the helper is at work, or waits for it.
        helped: it has done an item.
    """

    def __init__(self) -> None:
        self.ready = self.helped = False
        self._helper = Helper()
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._handout: Handout[Any, Any] | None = None
        self._closed = False
        self._thread = Thread(target=self._run, daemon=True)

    def assist(self, task: Callable[[Any], Any], handout: Handout[Any, Any] | None) -> None:
        """Help with this, once the work before is done; None: be ready for such a task."""
        if self._thread.ident is None:
            _STARTED.difference_update([one for one in tuple(_STARTED) if not one.is_alive()])
            self._thread.start()
            _STARTED.add(self)
        self._jobs.put((task, handout))

    def close(self) -> None:
        """End the helper, and soon this thread: it may wait for an import of the caller's."""
        self._closed = True
        self._jobs.put(None)
        self._helper.close()
        if (handout := self._handout) is not None:
            handout.wake()

    def is_alive(self) -> bool:
        """Whether this thread has not ended yet."""
        return self._thread.is_alive()

    def join(self, seconds: float) -> None:
        """Wait so long at most for this thread to end."""
        self._thread.join(seconds)

    def _run(self) -> None:
        for task, handout in iter(self._jobs.get, None):
            self._handout = handout
            if self._closed:
                break
            self._help(task, handout)
        self._handout = None

    def _help(self, task: Callable[[Any], Any], handout: Handout[Any, Any] | None) -> None:
        if not self.ready and handout is not None and handout.ends_within(_WORTH_S):
            return
        with suppress(UnknownTaskError, OSError):  # then it is done without help
            self._helper.learn(task)
            self.ready = True
            if handout is not None:
                self._serve(handout)

    def _serve(self, handout: Handout[Any, Any]) -> None:
        while (taken := handout.take(lambda: self._closed)) is not None:
            number, item = taken
            try:
                handout.put(number, self._helper.work(item))
                self.helped = True
            except Exception as error:  # noqa: BLE001
                handout.fail(number, error)


_STARTED: set[_Assistant] = set()
"""Not left by a thread of its own accord: the last task that it held is freed after all it does."""


@atexit.register
def _end_all() -> None:
    """Python may not end before these threads: one that is cut off inside of torch aborts it."""
    assistants, until = tuple(_STARTED), time.monotonic() + _PATIENCE_S
    for one in assistants:
        one.close()
    for one in assistants:
        one.join(max(0.0, until - time.monotonic()))


class _Threads:
    """torch's threads in this process: one, for its sums depend on their number.

    Where no helper works beside it, the work whose result does not (`ops/threads.py`) has as many
    as torch had.
    """

    def __init__(self) -> None:
        self._before = 0
        self._exact = ExitStack()

    def settle(self, *, alone: bool) -> None:
        """Before each item; torch may come with the first."""
        torch, exact = (sys.modules.get(name) for name in ("torch", "wildshape.ops.threads"))
        if torch is not None and not self._before:
            self._before = torch.get_num_threads()
            torch.set_num_threads(1)
            if exact is not None and alone:
                self._exact.enter_context(exact.exact_on(self._before))
        if not alone:
            self._exact.close()

    def restore(self) -> None:
        """As many as there were."""
        self._exact.close()
        if self._before:
            sys.modules["torch"].set_num_threads(self._before)
