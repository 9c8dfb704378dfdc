# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work spread over a Ray cluster, as `processes` spreads it over the processes of one machine."""

import os
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any, TypeVar

from wildshape.errors import BadInputError, load_library
from wildshape.parallel.processes import guarded

Item = TypeVar("Item")
Result = TypeVar("Result")

_RETRIES = 3
_AHEAD = 2


def on_ray(
    task: Callable[[Item], Result], items: Iterable[Item], address: str, workers: int | None
) -> Iterator[Result]:
    """`task(item)` of all items in the order in which the work ends, on a Ray cluster.

    A task whose worker or machine is lost is worked on again elsewhere. Its machines need the same
    Wildshape, and see the same files under the same paths.

    Args:
        task: can be pickled, as items and results.
        items: taken as they are needed.
        address: of the cluster's head, `auto` for the one that this machine belongs to, `local`
            for one that is started on this machine and stopped at the end.
        workers: how many processors a local cluster uses.

    Raises:
        MissingExtraError: Ray is not installed.
        BadInputError: no cluster there, or an item whose workers died again and again.
        Exception: what the task raised.
    """
    ray = load_library("ray", "--ray needs Ray", "pip install 'wildshape[ray]'")
    ours = not ray.is_initialized()
    if ours:
        _connect(ray, address, workers)
    try:
        yield from _spread(ray, task, items)
    finally:
        if ours:
            ray.shutdown()


def _spread(ray: Any, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    remote = ray.remote(max_retries=_RETRIES)(guarded)
    shared = ray.put(task)
    rest = iter(items)
    ahead = _AHEAD * max(int(ray.cluster_resources().get("CPU", 1)), 1)
    running = {remote.remote(shared, item): item for item in islice(rest, ahead)}
    while running:
        (done,), _ = ray.wait(list(running), num_returns=1)
        item = running.pop(done)
        running |= {remote.remote(shared, more): more for more in islice(rest, 1)}
        yield _fetched(ray, done, item)


def _fetched(ray: Any, done: Any, item: object) -> Any:
    try:
        made = ray.get(done)
    except ray.exceptions.RayError as lost:
        raise BadInputError(
            f"{item}: the Ray workers that worked on it were lost {_RETRIES + 1} times"
            f" ({type(lost).__name__}); look at the cluster's logs, then repeat the command."
        ) from lost
    if isinstance(made, Exception):
        raise made
    return made


def _connect(ray: Any, address: str, workers: int | None) -> None:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray would tell its makers
    how: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if address == "local":
        how |= {"num_cpus": workers, "include_dashboard": False}
    try:
        ray.init(address=address, **how)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise BadInputError(
            f"--ray {address}: no Ray cluster answers there ({error}); start one by"
            " `ray start --head`, or pass --ray local."
        ) from error
