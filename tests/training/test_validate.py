# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Held-out figures of a network that knows cars."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from tests.packed import packed

from wildshape.geometry.transforms.rotation import random_rotation, rotation_angle
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.method.choose_hypothesis import choose_hypothesis
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.multiview import LossConfig
from wildshape.method.network import Poses
from wildshape.training import validate as validation
from wildshape.training.batches.views import ViewConfig, ViewSampler
from wildshape.training.config import ValidationConfig
from wildshape.training.validate import truth_figures, usual_up, validate

TRACKS, VIEWS = 3, 3


@pytest.fixture(scope="module")
def known():
    return load(raw=True)


@pytest.fixture(scope="module")
def sampler(known, car_store):
    points = known.settings.input_points
    config = ViewConfig(tracks=TRACKS, views=VIEWS, points=points, turn="facing", roll_rad=0.02)
    return ViewSampler(car_store, np.arange(len(car_store)), config)


@pytest.fixture(scope="module")
def loss(known):
    settings = known.settings
    return LossConfig(settings.beta, settings.projection, settings.belief)


def test_a_registered_scan_is_posed_as_its_target_by_a_network_that_can_pose(
    known, sampler, loss, monkeypatch
):
    """Of the very batch whose terms are taken; each of the other figures by hand."""
    batch = sampler.draw(7)
    monkeypatch.setattr(sampler, "draw", lambda *_: batch)
    found = validate(known.network, sampler, loss, 1, "cpu")
    assert 0 < found.cycle_deg < 8
    with torch.no_grad():
        own = choose_hypothesis(known.network, batch.scans, batch.centres, loss)
    cost = own.cost(loss.beta)
    assert found.cost_median == pytest.approx(float(cost.median()))
    assert found.cost_p90 == pytest.approx(float(cost.quantile(0.9)))
    shapes = own.shapes[batch.reference].repeat_interleave(VIEWS, 0)
    posed = shapes[:, None] @ own.poses.rotation.mT + own.poses.translation[:, :, None]
    scores = score_hypotheses(batch.scans, batch.centres, posed, loss.projection)
    best = scores.cost(loss.beta).argmin(1, keepdim=True)
    observation = float(scores.observation.gather(1, best).mean())
    assert found.observation == pytest.approx(observation, rel=1e-4)
    projection = float(scores.projection.gather(1, best).mean())
    assert found.projection == pytest.approx(projection, rel=1e-4)


def test_a_scan_is_registered_to_the_next_of_its_track_and_posed_as_it_is_seen_there(
    known, sampler, loss, monkeypatch
):
    """On the object each lies where it lay; the angle is that between both poses of the next."""
    batch, generator = sampler.draw(3), torch.Generator().manual_seed(0)
    count = TRACKS * VIEWS
    rotation, again = random_rotation(2 * count, generator).view(2, count, 1, 3, 3)
    translation = torch.rand(count, 1, 3, generator=generator)
    given = []

    def posed_again(_network, scans, centres, _rule):
        given.append(scans + centres[:, None])
        return SimpleNamespace(pose=Poses(again, translation, torch.zeros(count, 1)))

    monkeypatch.setattr(validation, "choose_hypothesis", posed_again)
    poses = Poses(rotation, translation, torch.zeros(count, 1))
    found = validation._cycle_angle(known.network, sampler, loss, batch, poses)
    T = SE3(rotation[:, 0], translation[:, 0] + batch.centres)
    order = torch.tensor([1, 2, 0, 4, 5, 3, 7, 8, 6])
    on_object = T.inverse().apply(batch.scans + batch.centres[:, None])
    moved = T[order].apply(on_object)
    centred, centres, turn = sampler.as_posed(moved)
    torch.testing.assert_close(given[0], centred + centres[:, None], atol=1e-3, rtol=0)
    expected = rotation_angle(rotation[order, 0].mT @ turn.mT @ again[:, 0])
    torch.testing.assert_close(found, expected, atol=1e-3, rtol=0)


def test_up_is_where_level_sensors_say(known, sampler):
    up = usual_up(known.network, known.settings, sampler, 4)
    assert up is not None
    x, y, z = up
    assert y == 0.0
    assert x**2 + z**2 == pytest.approx(1.0)
    assert z > 0.99


@pytest.mark.parametrize("changed", [{"sensor": "camera"}, {"facing": False}])
def test_of_other_networks_nobody_says_which_way_is_up(known, sampler, changed):
    assert usual_up(known.network, replace(known.settings, **changed), sampler, 4) is None


def test_tracks_without_truth_give_no_figures(known, cars, tmp_path):
    store = packed(tmp_path / "store", [replace(cars[0], T_sensor_object=None, shape=None)])
    assert truth_figures(known.network, known.settings, store, [0], "yaw", ValidationConfig()) == {}
