# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over processes of this machine; what a killed one held is done again by another.

Each worker is a fresh interpreter talking through pipes rather than a `multiprocessing` child:
a fork after torch has started its threads may hang, and a spawned child would run the caller's
script again where that has no `if __name__ == "__main__"`. A worker ends with its parent.
"""

import os
import pickle
import subprocess
import sys
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, BinaryIO, TypeVar, cast

from wildshape.errors import BadInputError

Item = TypeVar("Item")
Result = TypeVar("Result")

_AHEAD = 4
_ATTEMPTS = 3


def in_order(
    task: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> Iterator[Result]:
    """`task(item)` of all items, in order, by several processes; few results are kept in memory.

    Args:
        task: can be pickled, as items and results; works on an item anew where a worker died.
        items: taken as they are needed.
        workers: how many processes.

    Raises:
        BadInputError: a worker was killed three times over one item.
        Exception: what the task raised.
    """
    waiting: deque[Future[Result]] = deque()
    with _workers(task, workers) as submit:
        for item in items:
            waiting.append(submit(item))
            if len(waiting) > _AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def as_done(
    task: Callable[[Item], Result], items: Iterable[Item], workers: int
) -> Iterator[Result]:
    """As `in_order`, but in the order in which the work ends: a long item holds up no other."""
    rest = iter(items)
    with _workers(task, workers) as submit:
        running = {submit(item) for item in islice(rest, 2 * workers)}
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                running |= {submit(item) for item in islice(rest, 1)}
                yield future.result()


@contextmanager
def _workers(
    task: Callable[[Item], Result], workers: int
) -> Iterator[Callable[[Item], "Future[Result]"]]:
    """What takes items; at the end the processes are gone, whatever they were doing."""
    team = [_Worker(task) for _ in range(workers)]
    idle: SimpleQueue[_Worker] = SimpleQueue()
    for worker in team:
        idle.put(worker)

    def work(item: Item) -> Result:
        worker = idle.get()
        try:
            return worker.work(item)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(workers)
    try:
        yield lambda item: pool.submit(work, item)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in team:
            worker.close()
        pool.shutdown(wait=True)


class _Worker:
    """A process that does one task on item after item."""

    def __init__(self, task: Callable[[Any], Any]):
        self._task = task
        self._closed = self._knows_task = False
        self._lock = Lock()
        self._process = self._start()

    def work(self, item: Any) -> Any:
        """The task's result; raises what the task raised."""
        for _ in range(_ATTEMPTS):
            try:
                return self._ask(item)
            except (EOFError, BrokenPipeError, pickle.UnpicklingError):
                if not self._begin_again():
                    break
        raise BadInputError(
            f"{item}: the process that worked on it ended early {_ATTEMPTS} times, perhaps for"
            " lack of memory; see its message above, or use fewer --workers."
        )

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._closed = True
            self._end()

    def _begin_again(self) -> bool:
        with self._lock:
            if not self._closed:
                self._end()
                self._process, self._knows_task = self._start(), False
            return not self._closed

    def _start(self) -> "subprocess.Popen[bytes]":
        paths = os.pathsep.join(p for p in sys.path if p)
        return subprocess.Popen(
            [sys.executable, "-c", "from wildshape.parallel.processes import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        )

    def _ask(self, item: Any) -> Any:
        if not self._knows_task:
            self._send(self._task)
            self._knows_task = True
        self._send(item)
        made = pickle.load(cast("BinaryIO", self._process.stdout))
        if isinstance(made, Exception):
            raise made
        return made

    def _send(self, thing: Any) -> None:
        pipe = cast("BinaryIO", self._process.stdin)
        pickle.dump(thing, pipe)
        pipe.flush()

    def _end(self) -> None:
        self._process.kill()
        self._process.communicate()


def serve() -> None:
    """The worker's side: a task, then item after item, from stdin until it closes."""
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the task prints is no result
    items: SimpleQueue[Any] = SimpleQueue()
    try:
        task = pickle.load(source)
        Thread(target=_receive, args=(source, items), daemon=True).start()
        while True:
            pickle.dump(guarded(task, items.get()), sink, protocol=pickle.HIGHEST_PROTOCOL)
            sink.flush()
    except (EOFError, KeyboardInterrupt, BrokenPipeError):
        os._exit(0)


def _receive(source: BinaryIO, items: "SimpleQueue[Any]") -> None:
    """Hand items on; without a parent nobody needs their results."""
    while True:
        try:
            items.put(pickle.load(source))
        except EOFError:
            os._exit(0)


def guarded(task: Callable[[Any], Any], item: Any) -> Any:
    """What the task returns, or raises: something that arrives whole in another process."""
    try:
        return task(item)
    except Exception as error:  # noqa: BLE001
        return _sendable(error)


def _sendable(error: Exception) -> Exception:
    if isinstance(error, BadInputError):
        return BadInputError(str(error))
    try:
        return error if type(pickle.loads(pickle.dumps(error))) is type(error) else _told(error)
    except Exception:  # noqa: BLE001
        return _told(error)


def _told(error: Exception) -> RuntimeError:
    return RuntimeError("".join(traceback.format_exception(error)))
