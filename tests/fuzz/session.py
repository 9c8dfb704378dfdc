# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A run: inputs shared out among readers and processes; what breaks a rule is kept and said."""

import argparse
import hashlib
import os
import random
import re
import select
import time
import traceback
from collections import Counter
from importlib import import_module
from pathlib import Path

from tests.fuzz.inputs import Input, Inputs
from tests.fuzz.judge import Verdict
from tests.fuzz.lane import BROKEN, Batch, Lane, Place
from tests.fuzz.tally import Tally
from tests.fuzz.target import Target, save_tree

_BATCH, _KEPT, _REPORT_EVERY = 50, 3, 20.0
_POLL = 0.25


class Session:
    """One run with its valid inputs."""

    def __init__(self, folder: Path, options: argparse.Namespace) -> None:
        known: tuple[Target, ...] = import_module(options.targets).TARGETS
        chosen = [t for t in known if not options.only or t.name.startswith(tuple(options.only))]
        self._targets = {target.name: target for target in chosen}
        self._options, self._place = options, Place(folder / "seeds", folder / "work")
        self._signatures: Counter[str] = Counter()
        identity = [options.inputs, options.each, options.seed, sorted(self._targets)]
        self._tally = Tally(self._targets, identity, options.state)
        self._reported = time.monotonic()
        self._build()

    def run(self) -> int:
        """All inputs; returns the exit code."""
        plan = list(enumerate(self._plan()))
        left = iter([(n, batch) for n, batch in plan if n not in self._tally.done])
        lanes = [
            Lane(self._targets, self._place, self._options.seed, left)
            for _ in range(self._options.workers)
        ]
        planned = sum(batch.stop - batch.start for _, batch in plan)
        try:
            while any(lane.batch for lane in lanes):
                self._step(lanes)
                self._report(planned)
        finally:
            for lane in lanes:
                lane.end()
        self._tally.save()
        print(self._tally.table())
        return int(self._tally.failures > 0)

    def replay(self, number: int) -> int:
        """One input of the only target, its files kept, read with nothing around it."""
        (name,) = self._targets
        inputs = self._inputs(name)
        one = inputs.make(self._options.seed, number)
        print(f"{name} {number}: {self._keep(name, str(number), one)}")
        folder, _ = inputs.lay(one)
        try:
            count = sum(1 for _ in self._targets[name].read(folder))
            print(f"read: {count} arrays")
        except BaseException:  # noqa: BLE001
            traceback.print_exc()
        return 0

    def _build(self) -> None:
        """Valid inputs, written and read by a process of their own: this one is to be forked."""
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                for name, target in self._targets.items():
                    target.build(self._place.seeds / name)
                    self._inputs(name).read_valid()
                code = 0
            except BaseException:  # noqa: BLE001
                traceback.print_exc()
            finally:
                os._exit(code)
        if os.waitpid(pid, 0)[1]:
            raise RuntimeError("a valid input could not be written, or was refused")

    def _plan(self) -> list[Batch]:
        shares = sum(target.share for target in self._targets.values())
        batches = []
        for name, target in self._targets.items():
            count = max(self._options.each, round(self._options.inputs * target.share / shares))
            starts = range(0, count, _BATCH)
            batches += [Batch(name, start, min(start + _BATCH, count)) for start in starts]
        random.Random(0).shuffle(batches)
        return batches

    def _step(self, lanes: list[Lane]) -> None:
        """Take in what the lanes have found until now."""
        ready = select.select(lanes, [], [], _POLL)[0]
        for lane in lanes:
            found = lane.verdicts() if lane in ready else lane.overdue()
            for batch, number, verdict in found:
                self._count(batch, number, verdict)
            self._tally.done |= lane.go_on()

    def _count(self, batch: Batch, number: int, verdict: Verdict) -> None:
        name = batch.target
        self._tally.rows[name].count(verdict)
        if not verdict.failure:
            return
        signature = f"{name} {verdict.failure} {_place_of(verdict.detail)}"
        self._signatures[signature] += 1
        if self._signatures[signature] > _KEPT:
            return
        print(f"{name} {number}: {verdict.failure}: {verdict.detail[:900]}", flush=True)
        if verdict.failure != BROKEN:
            one = self._inputs(name).make(self._options.seed, number)
            print(f"    {self._keep(name, signature, one)}", flush=True)

    def _inputs(self, name: str) -> Inputs:
        return Inputs(self._targets[name], self._place.seeds / name, self._place.work)

    def _keep(self, name: str, what: str, one: Input) -> Path:
        """Write what replaces files of the valid input."""
        digest = hashlib.sha256(repr(sorted(one.changed.items())).encode()).hexdigest()[:6]
        word = re.sub(r"[^a-z0-9]+", "-", what.lower().removeprefix(name))[:60].strip("-")
        folder = self._options.out / name / one.seed / f"{word}-{digest}"
        save_tree(folder, {file: data or b"" for file, data in one.changed.items()})
        return folder

    def _report(self, planned: int) -> None:
        if time.monotonic() - self._reported > _REPORT_EVERY:
            self._reported = time.monotonic()
            print(self._tally.line(planned), flush=True)
            self._tally.save()


def _place_of(detail: str) -> str:
    """Where it went wrong, without what differs between inputs."""
    kind, _, where = detail.partition(" at ")
    return f"{kind.partition(':')[0]} {where}" if where else re.sub(r"[^A-Za-z ]+", "", detail)[:60]
