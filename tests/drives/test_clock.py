# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The time that a drive took is that of all its runs."""

from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.refusal import refused
from tests.stopping import Killed

from wildshape.drives import clock
from wildshape.drives.clock import Clock, silent


@pytest.fixture
def at(monkeypatch):
    """A clock that is set by hand."""
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(clock.time, "perf_counter", lambda: now.s)
    return now


def test_stages_of_a_run_that_goes_on_count_on(at, tmp_path: Path):
    """The page of a resumed drive said the seconds of its last run alone."""
    path = tmp_path / "seconds.json"
    first = Clock(silent).going_on(path)
    with first.stage("trajectory", 1):
        at.s += 5
    with suppress(Killed), first.stage("clusters", 9):
        at.s += 3
        raise Killed
    again = Clock(silent).going_on(path)
    for stage, spent in (("trajectory", 0), ("clusters", 4)):
        with again.stage(stage, 1):
            at.s += spent
    assert again.seconds == {"trajectory": 5.0, "clusters": 7.0}
    assert Clock(silent).going_on(path).seconds == again.seconds


def test_of_a_run_that_is_killed_at_once_a_second_of_a_stage_is_lost_at_most(at, tmp_path: Path):
    path = tmp_path / "seconds.json"
    with Clock(silent).going_on(path).stage("completion", 9) as done:
        for number in range(9):
            at.s += 0.7
            done(number)
            kept = Clock(silent).going_on(path).seconds.get("completion", 0.0)
            assert at.s - 100 - kept <= 1.0


def test_a_second_pass_counts_on_from_the_first_and_from_itself(at, tmp_path: Path):
    path = tmp_path / "seconds.json"
    seconds = {"completion": 8.0}
    for _ in range(2):
        second = Clock(silent).going_on(path, "second ", {"completion": 8.0})
        with second.stage("completion", 1):
            at.s += 2
        seconds = second.seconds
    assert seconds == {"completion": 8.0, "second completion": 4.0}


def test_a_damaged_file_is_named(tmp_path: Path):
    (tmp_path / "seconds.json").write_text('{"clusters": "soon"}')
    refused(Clock(silent).going_on, tmp_path / "seconds.json", match=r"seconds\.json")


def test_who_watches_is_told_how_much_of_which_stage_is_done(tmp_path: Path):
    told = []
    watched = Clock(lambda *said: told.append(said)).going_on(tmp_path / "seconds.json", "second ")
    with watched.stage("completion", 2) as done:
        done(1)
        done(2)
    assert told == [("second completion", 1, 2), ("second completion", 2, 2)]
