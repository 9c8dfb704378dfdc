# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a track is held to before and after headings are agreed; what is logged."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.strategies import rotation_about
from tests.training.worker import SMALLEST

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import Poses, ShapePoseNet
from wildshape.training import objectives
from wildshape.training.batches.fused import FusedBatch
from wildshape.training.batches.views import ViewSampler
from wildshape.training.objectives import (
    WeaklySupervised,
    own_anchor,
    turning_handicap,
)
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.self_training import objective
from wildshape.training.self_training.objective import SelfTaught, seen_from, shape_terms

VIEWS = replace(SMALLEST.views, tracks=4, views=3)


@pytest.fixture(scope="module")
def batch(car_store):
    return ViewSampler(car_store, np.arange(len(car_store)), VIEWS).draw(0, 0)


def searched_again(network, batch, config):
    """The reference scans scored by a search of their own, under their own shapes."""
    code = network.encode(batch.scans)
    poses, at = network.poses(code), batch.reference
    own = Poses(*(part[at] for part in poses))
    posed = own.apply(network.canonical(code[at]))
    scores = score_hypotheses(batch.scans[at], batch.centres[at], posed, config.projection)
    branch = (scores.cost(config.beta) - config.belief * own.log_belief).argmin(-1)
    anchor = batch.turn[at].mT @ own.choose(branch).rotation[:, 0]
    return anchor.repeat_interleave(len(batch.scans) // len(at), dim=0)


def anchors_held_to(network, batch, monkeypatch):
    """What the objective hands to the handicap."""
    seen = []

    def spy(rotation, turn, anchor):
        seen.append(anchor)
        return turning_handicap(rotation, turn, anchor)

    monkeypatch.setattr(objectives, "turning_handicap", spy)
    WeaklySupervised(network, SMALLEST.loss)(batch)
    return seen[0]


@pytest.mark.parametrize("seed", range(4))
def test_the_anchor_is_that_of_a_search_of_its_own(batch, seed, monkeypatch):
    torch.manual_seed(seed)
    network = ShapePoseNet(SMALLEST.network)
    expected = searched_again(network, batch, SMALLEST.loss)
    found = anchors_held_to(network, batch, monkeypatch)
    torch.testing.assert_close(found, expected, atol=1e-6, rtol=0)


def test_agreed_headings_take_the_anchors_place(batch, monkeypatch):
    torch.manual_seed(0)
    network = ShapePoseNet(SMALLEST.network)
    agreed = random_rotation(12, torch.Generator().manual_seed(3))
    found = anchors_held_to(network, batch._replace(anchor=agreed), monkeypatch)
    torch.testing.assert_close(found, agreed)


def test_the_least_cost_of_the_reference_scan_decides(batch):
    rotation = random_rotation(12 * 4, torch.Generator().manual_seed(1)).view(12, 4, 3, 3)
    cost = torch.ones(12, 4)
    cost[batch.reference, torch.tensor([0, 1, 2, 3])] = 0.0
    anchor = own_anchor(batch, rotation, cost).view(4, 3, 3, 3)
    for track, at in enumerate(batch.reference.tolist()):
        expected = batch.turn[at].T @ rotation[at, track]
        torch.testing.assert_close(anchor[track], expected.expand(3, 3, 3))


def test_views_in_no_order_are_held_to_what_was_agreed_on_alone(batch):
    torch.manual_seed(0)
    network = ShapePoseNet(SMALLEST.network)
    loss = replace(SMALLEST.loss, time_ordered=False, agree_at=(0.5,))
    objective = WeaklySupervised(network, loss)
    poses = network.poses(network.encode(batch.scans))
    agreed = torch.arange(len(batch.scans)) % 2 == 0
    anchor = batch.turn.mT @ poses.rotation[:, 1]
    held = batch._replace(anchor=torch.where(agreed[:, None, None], anchor, 0.0))
    handicap = objective._handicap(held, poses, torch.zeros(len(batch.scans), 4))
    assert bool((handicap[~agreed] == 0).all())
    assert bool((handicap[agreed, 1] == 0).all())
    assert bool((handicap[agreed] > 1).any())


def objectives_of(batch, network, belief):
    """What both objectives ask of a network that has seen these scans."""
    turns, ends = batch.turn[:4], torch.full((4,), 0.1)
    shapes, sensors = torch.randn(4, 80, 3), 5 * torch.randn(4, 2, 3)
    taught = FusedBatch(
        batch.scans[:4], turns, torch.ones(4, 3), shapes, sensors, ends, torch.zeros(4, 0, 6)
    )
    yield WeaklySupervised(network, replace(SMALLEST.loss, belief=belief))(batch).loss
    rules = replace(SMALLEST.self_training.loss, belief=belief)
    yield SelfTaught(network, False, distances=rules)(taught).loss


def test_one_field_leaves_the_selector_out(batch):
    """Other weights of what is left out change no gradient."""
    grads = []
    for belief in (0.1, 0.9):
        torch.manual_seed(0)
        network = ShapePoseNet(replace(SMALLEST.network, selector=False))
        torch.stack(list(objectives_of(batch, network, belief))).sum().backward()
        grads.append([p.grad for p in network.parameters()])
    torch.testing.assert_close(*grads)


def test_the_selector_is_taught_to_believe_in_the_winner(batch):
    """The loss is the less, the more the branch that wins is believed in."""
    torch.manual_seed(0)
    network = ShapePoseNet(replace(SMALLEST.network, selector=True))
    drawn = torch.get_rng_state()
    found = []
    for belief in (0.0, 0.5):
        torch.set_rng_state(drawn)
        found.append(list(objectives_of(batch, network, belief)))
    for without, taught in zip(*found):
        nats = (taught - without).detach() / 0.5
        assert 0.25 < float(nats) < 3.0  # of four alike it is 1.4


@pytest.mark.parametrize("complete", [False, True])
def test_of_what_sensors_did_not_see_nothing_is_taught_unless_shapes_are_whole(
    batch, complete, monkeypatch
):
    handed = []

    def terms(shapes, targets, known, config):
        handed.append((shapes, known))
        return shape_terms(shapes, targets, known, config)

    monkeypatch.setattr(objective, "shape_terms", terms)
    network = ShapePoseNet(replace(SMALLEST.network, mirror=False))
    targets, sensors = torch.randn(4, 80, 3), torch.tensor((0.0, 9.0, 0.0)).expand(4, 2, 3)
    taught = FusedBatch(
        batch.scans[:4],
        batch.turn[:4],
        torch.ones(4, 3),
        targets,
        sensors,
        torch.full((4,), 0.1),
        torch.zeros(4, 0, 6),
    )
    SelfTaught(network, complete)(taught)
    ((shapes, known),) = handed
    if complete:
        assert known is None
    else:
        expected = seen_from(shapes.detach(), sensors, taught.view_top, mirror=False)
        assert torch.equal(known, expected)
        assert 0 < int(known.sum()) < known.numel()


def test_what_is_taught_does_not_depend_on_the_size_of_the_objects():
    generator = torch.Generator().manual_seed(0)
    scans, shapes, sensors = (torch.randn(4, n, 3, generator=generator) for n in (64, 80, 2))
    rotation = random_rotation(4, generator)
    found = []
    for unit in (1.0, 0.2):
        torch.manual_seed(1)
        network = ShapePoseNet(replace(SMALLEST.network, scale=2 * unit))
        places = (unit * part for part in (torch.ones(4, 3), shapes, 5 * sensors))
        ends = torch.full((4,), 0.1)
        batch = FusedBatch(
            unit * scans, rotation, *places, view_top=ends, rays=torch.zeros(4, 0, 6)
        )
        found.append(SelfTaught(network, False, unit=unit)(batch))
    large, small = found
    torch.testing.assert_close(large.loss, small.loss, atol=1e-3, rtol=1e-3)
    # What is logged is in metres: a fifth for an object a fifth as large.
    assert list(small.terms) == ["pose", "coverage", "precision"]
    for name, metres in small.terms.items():
        torch.testing.assert_close(large.terms[name], 5 * metres, atol=1e-3, rtol=1e-3)


def branches(degrees):
    """One scan's branches, each turned about z against the reference by these angles."""
    return torch.stack([rotation_about((0.0, 0.0, 1.0), math.radians(d)) for d in degrees])


def test_branches_that_turn_the_object_around_cannot_win():
    rotation = branches([0, 80, 100, 180, -80, -100])[None]
    eye = torch.eye(3, dtype=torch.float64)[None]
    handicap = turning_handicap(rotation, eye, eye)[0].tolist()
    assert [h > 50 for h in handicap] == [False, False, True, True, False, True]
    assert [h for h in handicap if h <= 50] == [0, 0, 0]
    assert handicap[3] == pytest.approx(max(handicap))


def test_the_turn_of_training_is_taken_off():
    """Scans turned at random hold the same handicaps: poses are compared as recorded."""
    anchor = random_rotation(6, torch.Generator().manual_seed(0)).double()
    turn = random_rotation(6, torch.Generator().manual_seed(1)).double()
    relative = branches([0, 60, 120, 180])
    recorded = anchor[:, None] @ relative
    still = turning_handicap(recorded, torch.eye(3).double().repeat(6, 1, 1), anchor)
    turned = turning_handicap(turn[:, None] @ recorded, turn, anchor)
    torch.testing.assert_close(turned, still)
    assert (still == 0).tolist() == [[True, True, False, False]] * 6


def test_what_is_logged_is_called_what_it_is(batch):
    network = ShapePoseNet(SMALLEST.network)
    weak = WeaklySupervised(network, SMALLEST.loss)(batch)
    assert list(weak.terms) == ["observation", "projection"]
    meter = Meter(SMALLEST.network.branches, 0, torch.device("cpu"))
    meter.write(torch.tensor(0), weak)
    read = meter.read(1)
    assert {name: read[name] for name in weak.terms} == pytest.approx(
        {name: float(value) for name, value in weak.terms.items()}
    )
