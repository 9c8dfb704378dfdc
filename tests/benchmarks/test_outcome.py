# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What benchmarks say of their bars is computed, and what they write can be read again."""

import csv
import importlib
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def load(monkeypatch):
    """Imports a module of `benchmarks` as its own scripts do."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    before = set(sys.modules)
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(ROOT / "benchmarks")):
            del sys.modules[name]


def test_bars_follow_from_the_medians(load, capsys):
    made = load("outcome").Outcome("made")
    made.add("case", {"ours": [1.0, 2.0, 9.0], "theirs": [3.0, 5.0, 4.0]}, off={"ours": 0.5})
    made.at_least("case", "ours", "theirs", 2.0)
    made.at_least("case", "ours", "theirs", 2.1)
    made.at_least("case", "ours", "absent", 2.0)
    assert [bar.split()[-1] for bar in made.bars] == ["met", "MISSED"]
    assert made.notes == ["not measured: case: absent / ours >= 2"]
    assert "ratio" in capsys.readouterr().out
    assert [row["ratio"] for row in made.rows] == [1.0, 2.0]
    assert [row["off"] for row in made.rows] == [0.5, ""]


def test_three_files(load, tmp_path):
    made = load("outcome").Outcome("made")
    made.add("case", {"ours": [1.0], "theirs": [1234.0]})
    made.bar("enough", 1.0, 2.0)
    made.publish(tmp_path, small=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["made.csv", "made.json", "made.svg"]
    with (tmp_path / "made.csv").open() as file:
        assert [row["method"] for row in csv.DictReader(file)] == ["ours", "theirs"]
    said = json.loads((tmp_path / "made.json").read_text())
    assert said["form"] == "small"
    assert said["bars"] == ["bar: enough <= 2: 1 met"]
    assert "1,234 (1,234 x)" in (tmp_path / "made.svg").read_text()


def test_turns_leave_out_the_first_and_repeat_the_fast(load):
    calls = {"fast": 0, "slow": 0}

    def work(name, milliseconds):
        calls[name] += 1
        return milliseconds

    turns = load("turns")
    assert turns._calls_a_round({"fast": 1.0, "slow": 3.9, "slowest": 40.0}) == {
        "fast": 5,
        "slow": 5,
        "slowest": 1,
    }
    found = turns.take_turns({"fast": lambda: work("fast", 1)}, seconds=0.0, at_least=2)
    assert len(found["fast"]) == calls["fast"] - 1


def test_the_runner_goes_on_after_a_failure_and_says_so(load, monkeypatch, capsys, tmp_path):
    run = load("run")
    (tmp_path / "bench_a.py").write_text("raise SystemExit(3)")
    (tmp_path / "bench_b.py").write_text(
        "print('bar: b <= 1: 0 met')\nprint('bar: c <= 1: 2 MISSED')"
    )
    monkeypatch.setattr(run, "HERE", tmp_path)
    monkeypatch.setattr(sys, "argv", ["run.py"])
    assert run.main() == 1
    said = capsys.readouterr().out
    assert "FAILED: bench_a.py" in said
    assert said.strip().endswith("1 of 2 bars met")
