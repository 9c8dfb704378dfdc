# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work in several processes: order, errors, and helpers that are killed."""

import os
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from threading import Event, Thread

import numpy as np
import pytest

from wildshape.datasets.tracks.conversion import Part
from wildshape.drives.tracking.sightings import Sightings
from wildshape.errors import BadInputError
from wildshape.io import inputs
from wildshape.parallel import processes
from wildshape.parallel.handout import Handout
from wildshape.parallel.helper import name_of
from wildshape.parallel.team import ALONE, cores, team
from wildshape.records import Track

PLAIN_SCRIPT = """
import time
from itertools import repeat
from wildshape.parallel import processes
from wildshape.parallel.team import team
processes._WORTH_S = 0.0
print("begun")

class OfTheScript:
    def __call__(self, number):
        return -number

with team(2) as two:
    for _ in two.as_done(time.sleep, repeat(0.01)):
        if two.worked == 2:
            break
    print(list(two.in_order(OfTheScript(), [1])))
"""

SHORT_SCRIPT = """
import torch
from wildshape.parallel import processes
from wildshape.parallel.team import team
processes._WORTH_S = 0.0

class Long(list):
    def __call__(self, number):
        return number

with team(2) as two:
    print(list(two.in_order(Long(torch.ones(20000)), [1])))
"""

FREEING_SCRIPT = """
import os, time
from wildshape.parallel import processes
from wildshape.parallel.team import team
processes._WORTH_S = 0.0

class Slow:
    def __call__(self, number):
        time.sleep(0.2)
        return number

    def __reduce__(self):
        time.sleep(0.5)
        return Slow, ()

    def __del__(self):
        time.sleep(0.5)
        os.write(1, b"freed")

with team(2) as two:
    print(list(two.in_order(Slow(), [1])), flush=True)
time.sleep(0.55)  # it is told, and being freed
"""

LEFT_SCRIPT = """
from itertools import count
from wildshape.parallel import processes
from wildshape.parallel.team import team
processes._WORTH_S = 0.0

def numbers():
    with team(3) as three:
        yield from three.in_order(abs, count())

found = numbers()
print(next(found))
"""


@pytest.fixture(autouse=True)
def _helpers_at_once(monkeypatch):
    monkeypatch.setattr(processes, "_WORTH_S", 0.0)


@pytest.fixture
def two():
    with team(2) as found:
        yield found


@dataclass(frozen=True)
class Task:
    """Squares a number; this process waits until a helper has come to the first of its items."""

    folder: Path
    here: int = field(default_factory=os.getpid)

    def __call__(self, number):
        os.write(1, b"a line that is no result\n")
        if os.getpid() == self.here:
            wait_for(self.folder / "came")
            return self.done_here(number)
        (self.folder / "came").touch()
        return self.done_by_a_helper(number)

    def done_here(self, number):
        return number * number

    def done_by_a_helper(self, number):
        return number * number


class Who(Task):
    def done_here(self, number):
        return os.getpid()

    done_by_a_helper = done_here


class Group(Task):
    def done_here(self, number):
        return os.getpgid(0)

    done_by_a_helper = done_here


class KilledOnce(Task):
    """Every second helper is killed at its item; `done` tells who did which."""

    def done_here(self, number):
        with (self.folder / "done").open("a") as file:
            file.write(f"{number}\n")
        return number

    def done_by_a_helper(self, number):
        mark = self.folder / f"killed at {number}"
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return self.done_here(number)


class KilledAlways(Task):
    def done_by_a_helper(self, number):
        os.kill(os.getpid(), signal.SIGKILL)


class Refused(Task):
    def done_by_a_helper(self, number):
        raise BadInputError(f"item {number}: refused.")


class EndOfFile(Task):
    def done_by_a_helper(self, number):
        raise EOFError("of the task itself")


def wait_for(file):
    until = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < until
        time.sleep(0.002)


def test_results_come_in_order(two, tmp_path):
    assert list(two.in_order(Task(tmp_path), range(40))) == [i * i for i in range(40)]
    assert sorted(two.as_done(Task(tmp_path), range(20))) == [i * i for i in range(20)]


def test_every_process_works(two, tmp_path):
    assert len(set(two.as_done(Who(tmp_path), range(20)))) == 2
    assert two.worked == 2


@pytest.mark.skipif(not hasattr(os, "getpgid"), reason="groups of processes are POSIX")
def test_ctrl_c_is_for_this_process_alone(two, tmp_path):
    groups = set(two.as_done(Group(tmp_path), range(20)))
    assert len(groups) == 2
    assert os.getpgid(0) in groups


def test_short_work_is_done_here(two, monkeypatch):
    monkeypatch.setattr(processes, "_WORTH_S", 60.0)
    assert list(two.as_done(str, range(3))) == ["0", "1", "2"]
    assert two.worked == ALONE.worked == 1


def test_helpers_told_of_long_work_help_at_once(tmp_path, monkeypatch):
    """They have begun before it does, and short work, too, is worth it then."""
    monkeypatch.setattr(processes, "_WORTH_S", 60.0)
    with team(2, soon=Who.__module__) as both:
        assert len(set(both.as_done(Who(tmp_path), range(20)))) == 2


def test_a_block_within_leaves_the_helpers_to_the_one_around(two, tmp_path):
    with team(two) as same:
        assert same is two
        assert len(set(same.as_done(Who(tmp_path), range(20)))) == 2
    (tmp_path / "came").unlink()
    with team(two) as again:
        assert len(set(again.as_done(Who(tmp_path), range(20)))) == 2


def test_what_cannot_be_told_to_helpers_beforehand_is_done_here(monkeypatch):
    monkeypatch.setattr(processes, "_WORTH_S", 60.0)
    with team(2, soon="no.such.module") as both:
        assert list(both.in_order(str, range(3))) == ["0", "1", "2"]


def test_what_a_killed_helper_held_is_done_again_and_once(two, tmp_path):
    assert list(two.in_order(KilledOnce(tmp_path), range(10))) == list(range(10))
    assert any(tmp_path.glob("killed at *"))
    assert sorted(map(int, (tmp_path / "done").read_text().split())) == list(range(10))


def test_what_kills_every_helper_is_given_up(two, tmp_path):
    with pytest.raises(BadInputError, match=r"^number \d+: the process .* ended early 3 times"):
        list(two.as_done(KilledAlways(tmp_path), range(10)))


SEEN = [Sightings(f"{number:04d}", (0, 1), ((0,), (1,)), (40, 50)) for number in range(16)]


@pytest.mark.parametrize(
    ("item", "name"),
    [
        (Part(3, "sequence 03"), "sequence 03"),
        (inputs.Part(0, Track("car-17", (np.zeros((20, 3), np.float32),), ("0",)), 0, 1), "car-17"),
        ((Path("raw/monday"), Path("out/monday")), str(Path("raw/monday"))),
        (SEEN, "0000 and 15 more"),
        (SEEN[4:5], "0004"),
        (np.arange(5), "some of the work"),
    ],
)
def test_a_lost_item_is_told_by_a_short_name(item, name):
    assert name_of(item) == name


@pytest.mark.parametrize(
    ("task", "error"),
    [(Refused, BadInputError(r"item \d: refused")), (EndOfFile, EOFError("of the task itself"))],
)
def test_errors_come_across(two, tmp_path, task, error):
    with pytest.raises(type(error), match=str(error)):
        list(two.in_order(task(tmp_path), range(10)))


def test_errors_of_the_items_come_too(two, tmp_path):
    def items():
        yield from range(5)
        raise BadInputError("cannot be read.")

    with pytest.raises(BadInputError, match="cannot be read"):
        list(two.in_order(Task(tmp_path), items()))


def test_work_that_is_left_ends_with_the_team(tmp_path):
    with team(2) as two:
        next(two.as_done(Task(tmp_path), count()))


def test_who_reads_an_item_is_not_waited_for():
    reading, go_on, waited = Event(), Event(), []

    def items():
        reading.set()
        waited.append(go_on.wait(10))
        yield 1

    handout = Handout(items())
    reader = Thread(target=handout.take, args=(lambda: False,))
    reader.start()
    reading.wait(60)
    handout.wake()
    go_on.set()
    reader.join()
    assert waited == [True]  # while it read


def test_a_team_may_end_while_its_helpers_start():
    """A pipe that was closed under its reader raised in a thread, where nobody caught it."""
    for number in range(16):
        with team(3) as three:
            list(three.as_done(time.sleep, [0.002 * number] * 4))


def test_a_script_without_a_guard_runs_once_and_its_own_tasks_are_done_here(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(PLAIN_SCRIPT)
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert run.stdout == "begun\n[-1]\n", run.stderr


@pytest.mark.parametrize(
    ("text", "said"),
    [(SHORT_SCRIPT, "[1]\n"), (FREEING_SCRIPT, "[1]\nfreed"), (LEFT_SCRIPT, "0\n")],
    ids=["its task is written for a helper", "its task is freed", "its work has not begun"],
)
def test_a_script_may_end_while(tmp_path, text, said):
    """A thread that Python ends inside of torch ends the process: "terminate called"."""
    script = tmp_path / "script.py"
    script.write_text(text)
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stdout, run.stderr) == (0, said, "")


def test_a_helper_ends_where_its_parent_was_killed_in_the_middle_of_a_message():
    helper = [sys.executable, "-c", "from wildshape.parallel.helper import serve; serve()"]
    half = pickle.dumps(("task", bytes(1000)))[:500]
    run = subprocess.run(helper, input=half, capture_output=True, timeout=60)
    assert (run.returncode, run.stdout, run.stderr) == (0, b"", b"")


def test_the_cores_of_this_process_are_used():
    assert 1 <= cores() <= (os.cpu_count() or 1)
    with team() as all_of_them:
        assert all_of_them.size == cores()
    with pytest.raises(BadInputError, match="--workers 0: expected 1 or more"), team(0):
        pass
