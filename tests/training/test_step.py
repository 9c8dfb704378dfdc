# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The step of the GPU, run on the CPU: it never waits, and it is the plain step."""

import copy
import math
from dataclasses import replace

import pytest
import torch
from benchmarks.no_wait import NoWait, WaitError  # pyright: ignore
from benchmarks.plain import plain_loss, twin_of  # pyright: ignore
from tests.training.steps import CPU, RECIPES, step_of, take
from tests.training.worker import SMALLEST

from wildshape.training.batches.resident import ResidentViews
from wildshape.training.config import learning_rate
from wildshape.training.objectives import Objective, WeaklySupervised
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.step import average_one_by_one, average_together


def batch_of(step, number):
    assert isinstance(step.views, ResidentViews)
    return step.views.batch(torch.tensor(number))


def weights(step):
    return [p.detach().clone() for p in step.state.network.parameters()]


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_nothing_in_a_step_waits(car_store, recipe):
    """Before and after headings are agreed, which changes no operation."""
    step = step_of(recipe, car_store)
    take(step, recipe, 1)  # the optimiser makes its state
    counted = []
    for number in (1, 2):
        if number == 2:
            step.views.hold(torch.eye(3).expand(len(car_store.scan_sizes), 3, 3))
        step.prepare(number, recipe)
        with NoWait() as watch:
            step.advance()
        counted.append(watch.launched)
    assert counted[0] == counted[1]
    assert 100 < counted[0].total() < 440  # some 20 less on a GPU, where the mean is one pass


@pytest.mark.parametrize("turn", ["so3", "facing"])
def test_no_way_of_drawing_waits(car_store, turn):
    recipe = replace(SMALLEST, views=replace(SMALLEST.views, turn=turn))
    views, number = step_of(recipe, car_store).views, torch.tensor(4)
    with NoWait():
        views.batch(number)


def test_the_watch_sees_what_waits():
    x = torch.arange(4.0)
    for wrong in (
        lambda: x.sum().item(),
        lambda: bool(x.sum() > 1),
        lambda: x[x > 1],
        lambda: x.nonzero(),
        lambda: x.unique(),
        lambda: x.long().bincount(),
        lambda: torch.tensor([1.0]),
    ):
        with pytest.raises(WaitError), NoWait():
            wrong()


def test_the_cpus_step_does_wait(car_store):
    """The winners' encoder gathers as many points as there are: good on a CPU, not in a graph."""
    step = step_of(SMALLEST, car_store, encoding="winners")
    step.prepare(0, SMALLEST)
    with pytest.raises(WaitError), NoWait():
        step.advance()


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_equal_batches_give_equal_losses(car_store, recipe):
    """Resident scans and static encoder against the CPU's own objective on the same batch."""
    step = step_of(recipe, car_store)
    network = copy.deepcopy(step.state.network)
    found = take(step, recipe, 1)
    batch = batch_of(step, 0)
    expected = WeaklySupervised(network, recipe.loss)(batch).loss
    torch.testing.assert_close(found[0], expected.detach(), rtol=1e-5, atol=0)


def test_a_hundred_steps_are_the_plain_ones(car_store):
    """Conv1d, cdist, Adam in a loop: every loss within a thousandth; most gradients are clipped."""
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=100, clip=0.3))
    step = step_of(recipe, car_store)
    plain = twin_of(step.state.network)
    adam = torch.optim.Adam(plain.parameters(), lr=1.0)
    expected = []
    for number in range(100):
        batch = batch_of(step, number)
        loss = plain_loss(plain, batch, recipe.loss)
        adam.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(plain.parameters(), recipe.optim.clip)
        adam.param_groups[0]["lr"] = learning_rate(number, recipe.optim)
        adam.step()
        expected.append(loss.item())
    found = take(step, recipe, 100)
    torch.testing.assert_close(found, torch.tensor(expected), rtol=1e-3, atol=0)
    assert found[-10:].mean() < 0.8 * found[:10].mean()


def test_a_step_depends_on_its_number_and_the_weights_alone(car_store):
    once, twice = step_of(SMALLEST, car_store), step_of(SMALLEST, car_store)
    take(once, SMALLEST, 3)
    take(twice, SMALLEST, 2)
    twice.views.batch(torch.tensor(77))
    take(twice, SMALLEST, 1, first=2)
    assert all(torch.equal(a, b) for a, b in zip(weights(once), weights(twice)))


def test_what_the_meter_reads_are_the_means_of_the_steps(car_store):
    step = step_of(SMALLEST, car_store)
    losses = take(step, SMALLEST, 5)
    read = step.meter.read(5)
    assert read["loss"] == pytest.approx(float(losses.mean()))
    assert sum(read["branch_shares"]) == pytest.approx(1.0, abs=1e-3)
    later = take(step, SMALLEST, 2, first=5)
    assert step.meter.read(7)["loss"] == pytest.approx(float(later.mean()))


def test_the_meters_ring_goes_round():
    meter = Meter(2, 0, CPU)
    winner = torch.zeros(1, dtype=torch.int64)
    for step in range(Meter.ROWS):
        loss = torch.tensor(float(step))
        meter.write(torch.tensor(step), Objective(loss, {"term": -loss}, winner))
    assert meter.losses(Meter.ROWS - 1, Meter.ROWS + 2).tolist() == [255.0, 0.0, 1.0]


@pytest.mark.parametrize("average", [average_one_by_one, average_together])
def test_either_average_moves_a_share_of_the_way(average):
    mean, now = [torch.zeros(3), torch.ones(2, 2)], [torch.ones(3), torch.full((2, 2), 5.0)]
    average(mean, now, torch.tensor(0.25))
    torch.testing.assert_close(mean[0], torch.full((3,), 0.25))
    torch.testing.assert_close(mean[1], torch.full((2, 2), 2.0))


def test_the_dials_hold_the_schedule(car_store):
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, average=0.99))
    dials = step_of(recipe, car_store).dials
    for number in (0, 3, 40):
        dials.turn(number, recipe)
        assert float(dials.rate) == pytest.approx(learning_rate(number, recipe.optim))
        assert float(dials.fresh) == pytest.approx(1 - min(0.99, (1 + number) / (10 + number)))
        assert math.isclose(int(dials.step), number)
