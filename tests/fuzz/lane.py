# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A process forked from one that has imported everything; it reads input after input.

One that dies or hangs tells by that which input it was, and another takes over after it.
"""

import faulthandler
import gc
import json
import os
import resource
import shutil
import signal
import time
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests.fuzz.inputs import Inputs
from tests.fuzz.judge import SECONDS, Judge, Verdict, trace
from tests.fuzz.target import Target

ADDRESS_SPACE = 6 << 30
"""Bytes that a reader may ask for (a size of 32 bits is asked for, and never touched), not use."""
BROKEN = "no input"
"""The fault is the fuzzer's own."""
_LONGEST_WAIT = 90.0
"""Seconds on the clock in which even a starved process makes some progress."""


@dataclass(frozen=True)
class Batch:
    """Inputs `start` to `stop` of a target."""

    target: str
    start: int
    stop: int


@dataclass(frozen=True)
class Place:
    """Where things lie.

    Attributes:
        seeds: valid inputs, by target.
        work: where damaged ones are written, a folder a lane.
    """

    seeds: Path
    work: Path


Numbered = tuple[int, Batch]
Found = tuple[Batch, int, Verdict]


class Lane:
    """The parent's side: one process at a time.

    Attributes:
        batch: what it works on; None where nothing is left.
    """

    def __init__(
        self, targets: Mapping[str, Target], place: Place, seed: int, left: Iterator[Numbered]
    ) -> None:
        """Begin with the next batch that is left."""
        self._targets, self._place, self._seed, self._left = targets, place, seed, left
        self._start()
        self._take()

    def fileno(self) -> int:
        """For `select`."""
        return self._records

    def verdicts(self) -> list[Found]:
        """What came in; where the process has died, what it died of."""
        data = os.read(self._records, 1 << 16)
        if not data:
            return [self._replace("crash")]
        assert self.batch is not None
        *lines, self._rest = (self._rest + data).split(b"\n")
        found = [
            (self.batch, self._next + i, Verdict(*json.loads(line))) for i, line in enumerate(lines)
        ]
        self._next += len(found)
        self._since, self._cpu = time.monotonic(), _cpu_seconds(self._pid)
        return found

    def overdue(self) -> list[Found]:
        """The input that hangs, if one does; its process is ended."""
        if self.batch is None:
            return []
        spent = _cpu_seconds(self._pid) - self._cpu
        waited = time.monotonic() - self._since
        if spent < SECONDS + 1 and waited < _LONGEST_WAIT:
            return []
        os.kill(self._pid, signal.SIGUSR1)  # says where it is
        time.sleep(0.3)
        os.kill(self._pid, signal.SIGKILL)
        return [self._replace("hang")]

    def go_on(self) -> set[int]:
        """Begin the next batch where one is done, which is returned."""
        if self.batch is None or self._next < self.batch.stop:
            return set()
        done = {self._number}
        self._take()
        return done

    def end(self) -> None:
        """End the process."""
        os.kill(self._pid, signal.SIGKILL)
        self._close()

    def _take(self) -> None:
        self._number, self.batch = next(self._left, (-1, None))
        if self.batch is not None:
            self._give(self.batch)

    def _give(self, batch: Batch) -> None:
        self.batch, self._next = batch, batch.start
        self._since, self._cpu = time.monotonic(), _cpu_seconds(self._pid)
        os.write(self._orders, json.dumps(asdict(batch)).encode() + b"\n")

    def _replace(self, failure: str) -> Found:
        """Another process goes on after the input at which this one ended."""
        assert self.batch is not None
        batch, failed, seconds = self.batch, self._next, time.monotonic() - self._since
        status = self._close()
        printed = self._folder / "printed.txt"
        text = printed.read_text(errors="replace")[:3000] if printed.exists() else ""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._start()
        self._give(Batch(batch.target, failed + 1, batch.stop))
        ended = os.WTERMSIG(status) if os.WIFSIGNALED(status) else status >> 8
        return batch, failed, Verdict(failure, f"ended by {ended} {text}", False, seconds, 0)

    def _close(self) -> int:
        """Forget a process that has ended; returns how it did."""
        os.close(self._orders)
        os.close(self._records)
        return os.waitpid(self._pid, 0)[1]

    def _start(self) -> None:
        orders, self._orders = os.pipe()
        self._records, records = os.pipe()
        self._folder, self._rest = self._place.work / os.urandom(4).hex(), b""
        self._pid = os.fork()
        if self._pid == 0:
            try:
                os.close(self._orders)
                os.close(self._records)
                seeds = self._place.seeds
                _serve(orders, records, self._folder, self._targets, seeds, self._seed)
            except BaseException:  # noqa: BLE001
                traceback.print_exc()
            finally:
                os._exit(99)
        os.close(orders)
        os.close(records)


class _Reader:
    """The process's side: it reads inputs and says what became of them."""

    def __init__(self, lane_folder: Path, records: int) -> None:
        self._folder, self._records = lane_folder, records
        self._judge = Judge(lane_folder / "printed.txt")
        self._ready: dict[str, Inputs] = {}

    def read(self, batch: Batch, target: Target, seeds: Path, seed: int) -> None:
        """The inputs of a batch."""
        if batch.target not in self._ready:
            self._ready[batch.target] = Inputs(target, seeds, self._folder / target.name)
            self._ready[batch.target].read_valid()
        inputs = self._ready[batch.target]
        for number in range(batch.start, batch.stop):
            found = self._verdict(inputs, seed, number)
            os.write(self._records, json.dumps(list(asdict(found).values())).encode() + b"\n")

    def _verdict(self, inputs: Inputs, seed: int, number: int) -> Verdict:
        try:
            one = inputs.make(seed, number)
        except Exception as error:  # noqa: BLE001
            return Verdict(BROKEN, trace(error), False, 0.0, 0)
        folder, size = inputs.lay(one)
        found = self._judge.judge(inputs.target, folder, size)
        inputs.take_back(one)
        return found


def _serve(
    orders: int, records: int, folder: Path, targets: Mapping[str, Target], seeds: Path, seed: int
) -> None:
    folder.mkdir(parents=True)
    reader = _Reader(folder, records)
    faulthandler.enable(file=2)
    faulthandler.register(signal.SIGUSR1, file=2, all_threads=True)
    _limit()
    gc.freeze()
    with os.fdopen(orders, "rb") as lines:
        for line in lines:
            batch = Batch(**json.loads(line))
            reader.read(batch, targets[batch.target], seeds / batch.target, seed)


def _limit() -> None:
    pages: Any = Path("/proc/self/statm").read_text().split()[0]
    size = int(pages) * resource.getpagesize() + ADDRESS_SPACE
    resource.setrlimit(resource.RLIMIT_AS, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _cpu_seconds(pid: int) -> float:
    """Processor time of a process until now."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
