# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training for a given time, by a clock that the test moves."""

from types import SimpleNamespace

import pytest

from wildshape.report.demo import time_budget
from wildshape.training.loop import Run
from wildshape.training.recipes import small


def bare_run(step=0):
    """As much of a run as the budget reads."""
    run = object.__new__(Run)
    run.recipe, run.provenance = small(), {}
    vars(run)["state"] = SimpleNamespace(step=step)
    return run


def train(seconds, rate, monkeypatch, stall=0.0):
    """Steps and time of a run on a machine of `rate(step)` steps a second."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(time_budget.time, "monotonic", lambda: clock.now)
    run, chosen, plans, agreed = bare_run(), time_budget.TimeBudget(seconds), [], []
    while run.state.step < run.recipe.optim.steps:
        steps = run.recipe.optim.steps
        if run.state.step in {int(share * steps) for share in run.recipe.loss.agree_at}:
            agreed.append(run.state.step)
            clock.now += stall
        run.state.step += 1
        clock.now += 1 / rate(run.state.step)
        if run.state.step % 25 == 0 and chosen.adjust(run):
            plans.append(run.recipe.optim.steps)
    return SimpleNamespace(step=run.state.step, now=clock.now, plans=plans, agreed=agreed)


def test_a_steady_machine_hardly_changes_its_plan(monkeypatch):
    done = train(150.0, lambda _: 10.0, monkeypatch)
    assert len(done.plans) <= 3
    assert max(done.plans) < 1.1 * min(done.plans)
    assert 0.85 * 150 < done.now < 150
    assert len(done.agreed) == len(small().loss.agree_at)


def test_stalls_do_not_upset_the_plan(monkeypatch):
    done = train(150.0, lambda _: 10.0, monkeypatch, stall=5.0)
    assert done.now == pytest.approx(150, rel=0.06)
    assert len(done.agreed) == len(small().loss.agree_at)


@pytest.mark.parametrize(("before", "after"), [(10.0, 4.0), (4.0, 12.0)])
def test_a_machine_that_changes(monkeypatch, before, after):
    done = train(150.0, lambda step: before if step < 300 else after, monkeypatch)
    assert 0.75 * 150 < done.now < 1.1 * 150
    assert len(done.agreed) == len(small().loss.agree_at)


def test_a_machine_far_too_slow_ends_all_the_same(monkeypatch):
    done = train(1.0, lambda _: 0.5, monkeypatch)
    assert done.step <= 27


@pytest.mark.parametrize("rate", [4.0, 2.0, 1.2])
def test_a_slow_machine_agrees_on_headings_later_and_as_often(monkeypatch, rate):
    """The shares had passed when the number of steps was first known."""
    done = train(95.0, lambda _: rate, monkeypatch)
    assert len(done.agreed) == len(small().loss.agree_at)
    assert done.agreed == sorted(set(done.agreed))


def test_the_plan_is_what_the_checkpoint_says(monkeypatch):
    run = bare_run(step=75)
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(time_budget.time, "monotonic", lambda: clock.now)
    chosen = time_budget.TimeBudget(100.0)
    clock.now = 10.0
    assert chosen.adjust(run)
    assert run.provenance["recipe"]["optim"]["steps"] == run.recipe.optim.steps == chosen.planned
