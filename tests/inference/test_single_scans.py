# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tilted scans are looked at twice, the cheaper answer stays."""

import numpy as np
import torch
from tests.turned import SCAN, turned_scans

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference import single_scans as module
from wildshape.inference.predictor import load
from wildshape.inference.single_scans import look, look_twice
from wildshape.method.choose_hypothesis import network_input


@torch.no_grad()
def test_a_second_look_never_costs_more_and_is_for_tilted_scans_alone(monkeypatch):
    predictor = load()
    of = predictor.settings
    scans = [np.load(SCAN), *turned_scans(7)]
    given = network_input(scans, of.input_points, of.sensor, of.facing)
    seen = []

    def counted(network, settings, given, sights):
        seen.append(len(given.scans))
        return look(network, settings, given, sights)

    first = look(predictor.network, of, given)
    monkeypatch.setattr(module, "look", counted)
    twice = look_twice(predictor.network, of, given)
    assert seen[0] == 8
    assert 1 <= sum(seen[1:]) <= 7, "one second look, and none at the scan that is upright"
    assert (twice.cost <= first.cost).all()
    changed = (twice.rotation - first.rotation).abs().amax((1, 2)) > 1e-6
    assert not changed[0]
    assert (twice.cost < first.cost)[changed].all()
    torch.testing.assert_close(twice.rotation[~changed], first.rotation[~changed])


def test_the_shipped_weights_know_a_car_at_any_roll():
    points = np.load(SCAN)
    predictor = load()
    upright = predictor.complete(points).pose
    turns = random_rotation(12, torch.Generator().manual_seed(0)).double()
    still = torch.zeros(3, dtype=torch.float64)
    scans = [SE3(turn, still).apply_numpy(points) for turn in turns]
    for turn, done in zip(turns, predictor.complete_many(scans)):
        off = (turn @ upright.rotation).mT @ done.pose.rotation
        assert torch.rad2deg(torch.acos(((off.trace() - 1) / 2).clamp(-1, 1))) < 10
