# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Batches that are drawn ahead are those of their steps."""

import threading
import time

import numpy as np
import pytest
import torch

from wildshape.parallel.helper import Helper
from wildshape.training.batches.host import HostViews
from wildshape.training.batches.views import ViewConfig, ViewSampler

CONFIG = ViewConfig(tracks=2, views=3, points=50, turn="facing", roll=0.5)


@pytest.fixture
def sampler(car_store):
    return ViewSampler(car_store, np.arange(len(car_store)), CONFIG)


def same(batch, other):
    return all(torch.equal(part, twin) for part, twin in zip(batch, other))


def noted(method, results):
    """The method, its results kept in a list."""

    def keep(self):
        results.append(method(self))
        return results[-1]

    return keep


def taken(views, step):
    views.prepare(step)
    batch = views.batch(torch.tensor(step))
    views.ahead()
    return batch


@pytest.mark.parametrize("workers", [1, 2])
def test_each_step_has_its_own_batch_whatever_came_before(car_store, sampler, workers):
    views = HostViews(sampler, 7, 1, torch.device("cpu"), workers)
    fresh = ViewSampler(car_store, np.arange(len(car_store)), CONFIG)
    for step in (3, 4, 5, 9, 2):
        assert same(taken(views, step), fresh.draw(7, step, 1)), step
    views.close()
    assert same(taken(views, 3), fresh.draw(7, 3, 1))
    views.close()


def test_processes_draw_ahead_and_end(sampler, monkeypatch):
    """A GPU takes a step in less time than its batch is drawn in."""
    began = []
    monkeypatch.setattr(Helper, "_running", noted(Helper._running, began))
    views = HostViews(sampler, 7, 0, torch.device("cpu"), 3)
    until, step = time.monotonic() + 60, 0
    while len({id(p) for p in began}) < 2 and time.monotonic() < until:
        assert same(taken(views, step), sampler.draw(7, step, 0))
        step += 1
    views.close()
    assert len(began) >= 2
    assert all(process.poll() is not None for process in began)


def test_the_next_batch_is_drawn_by_another_thread(sampler, monkeypatch):
    drawn, draw = {}, sampler.draw

    def noted(*seed):
        drawn[seed[1]] = threading.get_ident()
        return draw(*seed)

    monkeypatch.setattr(sampler, "draw", noted)
    views = HostViews(sampler, 7, 0, torch.device("cpu"))
    taken(views, 0)
    views.prepare(1)
    assert set(drawn) == {0, 1}
    assert threading.get_ident() not in drawn.values()


@pytest.mark.parametrize("workers", [1, 2])
def test_headings_agreed_on_hold_from_the_very_next_step(car_store, sampler, workers):
    views = HostViews(sampler, 7, 0, torch.device("cpu"), workers)
    taken(views, 0)
    anchors = torch.eye(3).expand(len(car_store.scan_sizes), 3, 3)
    views.hold(anchors)
    batch = taken(views, 1)
    assert same(batch, sampler.draw(7, 1, 0))
    assert torch.equal(batch[-1], anchors[:6])
    views.close()
