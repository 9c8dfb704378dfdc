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
    made.bar("a time, ms", 2.0, 1.0, kind="clock")
    assert [bar.rpartition(": ")[2].split(" ", 1)[1] for bar in made.bars] == [
        "met",
        "MISSED",
        "MISSED by this machine",
    ]
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


def test_small_enough_to_try_only_what_is_exact_is_judged(load, capsys):
    """Nothing is called oftener than needed, and no time of it is held against the machine."""
    calls: list[str] = []
    turns, outcome = load("turns"), load("outcome")
    parser = turns.options("made")
    parser.set_defaults(smoke=True, threads=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["bench_made.py"])
        assert turns.begin(parser).small
    times = turns.take_turns({"a": lambda: calls.append("a"), "b": lambda: None}, seconds=60.0)
    assert (calls, len(times["a"]), len(times["b"])) == (["a"], 1, 1)
    made = outcome.Outcome("made")
    made.add("case", {"ours": [1.0], "theirs": [1.0]})
    made.at_least("case", "ours", "theirs", 2.0)
    made.bar("a time, ms", 2.0, 1.0, kind="clock")
    made.bar("off", 2.0, 1.0)
    assert [bar.endswith("not judged at this size") for bar in made.bars] == [True, True, False]
    assert made.bars[-1].endswith(" MISSED")


@pytest.mark.parametrize(
    ("scripts", "status", "said"),
    [
        (["bar: b <= 1: 0 met"], 0, "1 of 1 bars met"),
        (["bar: b <= 1: 0 met", "bar: c <= 1: 2 MISSED"], 1, "1 of 2 bars met"),
        (["bar: b <= 1: 0 met", "bar: c <= 1: 2 MISSED by this machine"], 0, "1 missed by the"),
        (["bar: b <= 1: 0 met", "nothing"], 1, "FAILED: bench_1.py: it printed no bar"),
        (["bar: b <= 1: 0 met", "not measured: no browser"], 0, "1 of 1 bars met"),
    ],
    ids=["met", "missed", "missed by the clock", "silent", "excused"],
)
def test_the_runner_ends_with_what_counts(load, runner, scripts, status, said, capsys):
    run, folder = runner
    for i, line in enumerate(scripts):
        (folder / f"bench_{i}.py").write_text(f"print({line!r})")
    assert run.main() == status
    assert said in capsys.readouterr().out


def test_the_runner_goes_on_after_a_failure_and_says_so(runner, capsys):
    run, folder = runner
    (folder / "bench_a.py").write_text("raise SystemExit(3)")
    (folder / "bench_b.py").write_text("print('bar: b <= 1: 0 met')")
    assert run.main() == 1
    said = capsys.readouterr().out
    assert "FAILED: bench_a.py: exit status 3" in said
    assert said.strip().endswith("1 of 1 bars met")


@pytest.fixture
def runner(load, monkeypatch, tmp_path):
    """`run.py` in a folder of its own."""
    run = load("run")
    monkeypatch.setattr(run, "HERE", tmp_path)
    monkeypatch.setattr(sys, "argv", ["run.py"])
    return run, tmp_path


def test_the_smoke_form_keeps_no_results_and_leaves_none_out(runner, monkeypatch, capsys):
    run, folder = runner
    for name in ("a", next(iter(run.LEFT_OUT)).removeprefix("bench_").removesuffix(".py")):
        (folder / f"bench_{name}.py").write_text(
            "import sys; print('bar:', *sys.argv[1:], '<= 1: 0 met')"
        )
    monkeypatch.setattr(sys, "argv", ["run.py", "--smoke"])
    assert run.main() == 0
    given = [line for line in capsys.readouterr().out.splitlines() if line.startswith("bar:")]
    assert len(given) == 2
    assert all("--smoke" in line and "--out" in line and "results" not in line for line in given)
