# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A process that does a task on item after item, and is replaced where it is killed.

Each is a fresh interpreter talking through pipes rather than a `multiprocessing` child: a fork
after torch has started its threads may hang, and a spawned child would run the caller's script
again where that has no `if __name__ == "__main__"`. It ends with its parent.
"""

import gc
import os
import pickle
import subprocess
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any, BinaryIO, cast

from wildshape.errors import BadInputError, LostWorkersError

_ATTEMPTS = 3
_LOST = (EOFError, BrokenPipeError, pickle.UnpicklingError, ValueError)
"""The last of a pipe that `close` has closed meanwhile."""


class UnknownTaskError(Exception):
    """The task cannot be told to another process."""


class Helper:
    """A process beside this one, started when there is something to do."""

    def __init__(self) -> None:
        self._task = b""
        self._knows_task = self._closed = False
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def learn(self, task: Callable[[Any], Any]) -> None:
        """Take a task, and import all that it needs.

        Raises:
            UnknownTaskError: the task or what it needs does not come across.
            OSError: no process can be started.
        """
        try:
            self._task = pickle.dumps(task)
        except Exception as error:
            raise UnknownTaskError(str(error)) from error
        self._knows_task = False
        try:
            self._tell()
        except _LOST:
            return  # `work` begins again

    def work(self, item: Any) -> Any:
        """The task's result.

        Raises:
            LostWorkersError: the process died over this item again and again.
            Exception: what the task raised.
        """
        for _ in range(_ATTEMPTS):
            try:
                made = self._ask(item)
            except _LOST:
                if not self._begin_again():
                    break
                continue
            if isinstance(made, Exception):
                raise made
            return made
        raise LostWorkersError(
            f"{name_of(item)}: the process that worked on it ended early {_ATTEMPTS} times, perhaps"
            " for lack of memory; see its message above, or use fewer --workers."
        )

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._closed = True
            self._end()

    def _ask(self, item: Any) -> Any:
        if not self._knows_task:
            self._tell()
        return self._answer("item", pickle.dumps(item))

    def _tell(self) -> None:
        refused = self._answer("task", self._task)
        if refused is not None:
            raise UnknownTaskError(str(refused))
        self._knows_task = True

    def _answer(self, kind: str, payload: bytes) -> Any:
        process = self._running()
        pipe = cast("BinaryIO", process.stdin)
        pickle.dump((kind, payload), pipe)
        pipe.flush()
        return pickle.load(cast("BinaryIO", process.stdout))

    def _running(self) -> "subprocess.Popen[bytes]":
        with self._lock:
            if self._closed:
                raise EOFError
            if self._process is None:
                self._process = _start()
            return self._process

    def _begin_again(self) -> bool:
        with self._lock:
            if not self._closed:
                self._end()
                self._knows_task = False
            return not self._closed

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def name_of(item: object) -> str:
    """What a message calls an item: its text would be a page, or a bare number."""
    match item:
        case str() | Path():
            return str(item)
        case int():
            return f"number {item}"
        case (Path() as source, _):
            return str(source)
        case list() if item:
            more = f" and {len(item) - 1} more" if len(item) > 1 else ""
            return name_of(item[0]) + more
        case _:
            name = getattr(item, "name", getattr(getattr(item, "track", None), "name", None))
            return name if isinstance(name, str) else "some of the work"


def _start() -> "subprocess.Popen[bytes]":
    paths = os.pathsep.join(p for p in sys.path if p)
    return subprocess.Popen(
        [sys.executable, "-c", "from wildshape.parallel.helper import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        process_group=0,  # Ctrl-C is for the parent: in its first imports this one would say so
    )


def serve() -> None:
    """The helper's side: tasks and items from stdin until it closes."""
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the task prints is no result
    messages: SimpleQueue[tuple[str, bytes]] = SimpleQueue()
    Thread(target=_receive, args=(source, messages), daemon=True).start()
    work = _Work()
    try:
        while True:
            pickle.dump(work.answer(*messages.get()), sink, protocol=pickle.HIGHEST_PROTOCOL)
            sink.flush()
    except BrokenPipeError:
        os._exit(0)


class _Work:
    """The task last told, and its answers."""

    def __init__(self) -> None:
        self._task: Callable[[Any], Any] | None = None

    def answer(self, kind: str, payload: bytes) -> Any:
        """What the task makes of an item; nothing for a task that is understood."""
        if kind == "task":
            return self._learn(payload)
        loaded = guarded(pickle.loads, payload)
        if isinstance(loaded, Exception):
            return loaded
        return guarded(cast("Callable[[Any], Any]", self._task), loaded)

    def _learn(self, payload: bytes) -> Exception | None:
        """Import what the task needs; modules live as long as the process and are no garbage."""
        gc.disable()
        loaded = guarded(pickle.loads, payload)
        gc.freeze()
        gc.enable()
        if isinstance(loaded, Exception):
            return loaded
        self._task = loaded
        return None


def _receive(source: BinaryIO, messages: "SimpleQueue[tuple[str, bytes]]") -> None:
    """Hand messages on; without a parent nobody needs their answers."""
    while True:
        try:
            messages.put(pickle.load(source))
        except Exception:  # noqa: BLE001  the end, or half a message of a parent that was killed
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
