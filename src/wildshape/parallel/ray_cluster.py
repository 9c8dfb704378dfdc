# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over a Ray cluster, as `processes` spreads it over the processes of one machine."""

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar
from uuid import uuid4

from wildshape.errors import BadInputError, LostWorkersError, load_library
from wildshape.parallel.helper import guarded, name_of

Item = TypeVar("Item")
Result = TypeVar("Result")

_RETRIES = 3
_AHEAD = 2


@contextmanager
def on_ray(address: str, workers: int | None = None) -> "Iterator[RayCluster]":
    """A Ray cluster; one that is started here is stopped at the end of the block.

    Args:
        address: of the cluster's head, `auto` for the one that this machine belongs to, `local`
            for one that is started on this machine.
        workers: how many processors a local cluster uses.

    Raises:
        MissingExtraError: Ray is not installed.
        BadInputError: no cluster answers there.
    """
    ray = load_library("ray", "--ray needs Ray", "pip install 'wildshape[ray]'")
    ours = not ray.is_initialized()
    if ours:
        _connect(ray, address, workers)
    try:
        yield RayCluster(ray)
    finally:
        if ours:
            ray.shutdown()


class RayCluster:
    """A Ray cluster that is connected.

    A task whose worker or machine is lost is worked on again elsewhere. Its machines need the same
    Wildshape, and see the same files under the same paths.
    """

    def __init__(self, ray: Any) -> None:
        self._ray = ray
        self._remote = ray.remote(max_retries=_RETRIES)(_work)

    @property
    def size(self) -> int:
        """How many processors it has now; each does one item at a time."""
        return max(int(self._ray.cluster_resources().get("CPU", 1)), 1)

    @property
    def worked(self) -> int:
        """The same: who did what is not known."""
        return self.size

    def in_order(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """See `Processes.in_order`."""
        submit = self._told(task)
        ahead = _AHEAD * self.size
        waiting: deque[tuple[Any, Item]] = deque()
        for item in items:
            waiting.append((submit(item), item))
            if len(waiting) > ahead:
                yield self._fetched(*waiting.popleft())
        while waiting:
            yield self._fetched(*waiting.popleft())

    def as_done(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """See `Processes.as_done`."""
        submit = self._told(task)
        rest = iter(items)
        running = {submit(item): item for item in islice(rest, _AHEAD * self.size)}
        while running:
            (done,), _ = self._ray.wait(list(running), num_returns=1)
            item = running.pop(done)
            running |= {submit(more): more for more in islice(rest, 1)}
            yield self._fetched(done, item)

    def _told(self, task: Callable[[Item], Result]) -> Callable[[Item], Any]:
        """What sends an item to the cluster; the task itself travels once."""
        name, shared = uuid4().hex, [self._ray.put(task)]
        return lambda item: self._remote.remote(name, shared, item)

    def _fetched(self, done: Any, item: object) -> Any:
        try:
            made = self._ray.get(done)
        except self._ray.exceptions.RayError as lost:
            raise LostWorkersError(
                f"{name_of(item)}: the Ray workers that worked on it were lost {_RETRIES + 1} times"
                f" ({type(lost).__name__}); look at the cluster's logs, then repeat the command."
            ) from lost
        if isinstance(made, Exception):
            raise made
        return made


_task_of: dict[str, Callable[[Any], Any]] = {}


def _work(name: str, shared: list[Any], item: Any) -> Any:
    """The worker's side: the task is unpacked once, not for every item."""
    ray = load_library("ray", "this work needs Ray", "pip install 'wildshape[ray]'")

    if name not in _task_of:
        _task_of.clear()
        _task_of[name] = ray.get(shared[0])
    return guarded(_task_of[name], item)


@contextmanager
def _signals_kept() -> Iterator[None]:
    """Ray takes SIGTERM for itself: it ends the program with a dump of the stack."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # set by native code
                signal.signal(number, handler)


def _connect(ray: Any, address: str, workers: int | None) -> None:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray would tell its makers
    how: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if address == "local":
        how |= {"num_cpus": workers, "include_dashboard": False}
    try:
        with _signals_kept():
            ray.init(address=address, **how)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise BadInputError(
            f"--ray {address}: no Ray cluster answers there ({error}); start one by"
            " `ray start --head`, or pass --ray local."
        ) from error
