# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that simulate tracks, kept busy in order.

Each worker is a fresh interpreter talking through pipes rather than a `multiprocessing` child:
a fork after torch has started its threads may hang, and a spawned child would run the caller's
script again where that has no `if __name__ == "__main__"`.
"""

import os
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import BinaryIO, cast

from wildshape.errors import BadInputError, MissingExtraError
from wildshape.simulate.drive import RawTrack
from wildshape.simulate.job import Job

_AHEAD = 4


class _Worker:
    """One process that makes tracks of one job."""

    def __init__(self, job: Job):
        paths = os.pathsep.join(p for p in sys.path if p)
        self._process = subprocess.Popen(
            [sys.executable, "-c", "from wildshape.simulate.worker import serve; serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        )
        self._send(job)

    def make(self, index: int) -> RawTrack:
        """Track `index`; raises what the process raised."""
        try:
            self._send(index)
            made = pickle.load(cast("BinaryIO", self._process.stdout))
        except (EOFError, BrokenPipeError) as gone:
            raise RuntimeError("a simulation worker ended early; see its message above.") from gone
        if isinstance(made, Exception):
            raise made
        return made

    def _send(self, thing: Job | int) -> None:
        pipe = cast("BinaryIO", self._process.stdin)
        pickle.dump(thing, pipe)
        pipe.flush()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


def serve() -> None:
    """The worker's side: a job, then index after index, from stdin until it closes."""
    source, sink = sys.stdin.buffer, sys.stdout.buffer
    job: Job = pickle.load(source)
    while True:
        try:
            index = pickle.load(source)
        except (EOFError, KeyboardInterrupt):
            return
        try:
            made: RawTrack | Exception = job.track(index)
        except (BadInputError, MissingExtraError) as refused:
            made = refused
        except KeyboardInterrupt:
            return
        pickle.dump(made, sink, protocol=pickle.HIGHEST_PROTOCOL)
        sink.flush()


def in_parallel(job: Job, workers: int) -> Iterator[RawTrack]:
    """All tracks of a job in order, made by several processes; few are kept in memory."""
    crew = [_Worker(job) for _ in range(workers)]
    idle: SimpleQueue[_Worker] = SimpleQueue()
    for worker in crew:
        idle.put(worker)

    def make(index: int) -> RawTrack:
        worker = idle.get()
        try:
            return worker.make(index)
        finally:
            idle.put(worker)

    pool = ThreadPoolExecutor(workers)
    waiting: deque[Future[RawTrack]] = deque()
    try:
        for index in range(job.config.tracks):
            waiting.append(pool.submit(make, index))
            if len(waiting) > _AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()
        for worker in crew:
            worker.close()
        pool.shutdown(wait=True, cancel_futures=True)
