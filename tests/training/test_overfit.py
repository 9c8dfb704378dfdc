# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Does it learn at all? Eight cars, 300 steps of the tiny recipe, some 12 s of one core."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from wildshape.geometry.transforms.rotation import random_yaw, rotation_angle
from wildshape.inference.predictor import load
from wildshape.training.loop import fit, setup
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.recipes import tiny

RECIPE = replace(tiny(), optim=replace(tiny().optim, steps=300), validate_every=1000)


def mean_terms(run, network):
    """Loss and observation term over batches that are never trained on in this order."""
    objective = WeaklySupervised(network, RECIPE.loss)
    with torch.no_grad():
        rows = [objective(run.sampler.draw(99, step)) for step in range(8)]
    return np.mean([(float(r.loss), float(r.terms["observation"])) for r in rows], axis=0)


@pytest.fixture(scope="module")
def overfitted(car_store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("overfit")
    run = setup(RECIPE, car_store, folder, seed=0)
    before = mean_terms(run, run.state.network)
    path = fit(run)
    return load(path), before, mean_terms(run, run.state.mean)


def turned(track, generator):
    """Every scan turned by its own random yaw, and the true rotations of the turned scans."""
    turns = random_yaw(len(track.scans), generator).double()
    scans = [scan @ R.T.numpy().astype(np.float32) for scan, R in zip(track.scans, turns)]
    return scans, turns @ track.T_sensor_object.rotation


def errors(predictor, cars):
    """Degrees by which registration to the middle scan, and no rotation at all, are wrong."""
    generator = torch.Generator().manual_seed(7)
    found, identity = [], []
    for track in cars:
        scans, truth = turned(track, generator)
        relative = truth[track.middle] @ truth.mT
        others = torch.arange(len(scans)) != track.middle
        T_middle_scan = predictor.register_track(scans)
        found.append(rotation_angle(T_middle_scan.rotation @ relative.mT)[others])
        identity.append(rotation_angle(relative)[others])
    return tuple(torch.rad2deg(torch.cat(part)).numpy() for part in (found, identity))


def test_the_loss_falls(overfitted):
    """Seeds 0, 1, 2: the observation term falls 2.4 to 2.6 times, the loss 2.1 to 2.3 times.

    It starts low (0.28 m: an ellipsoid of a car's proportions) and 512 points on 256 cannot
    bring it under some 0.1 m.
    """
    _, before, after = overfitted
    assert after[1] < before[1] / 2
    assert after[0] < before[0] / 1.8


def test_scans_turned_at_random_are_registered(overfitted, cars):
    """Seeds 0, 1, 2: 62 to 73 % within 30 degrees, up to a half turn all of them, median 8 to 11.

    No rotation at all: 12 % and 97 degrees. The half turns that are left are METHOD 12's.
    """
    found, identity = errors(overfitted[0], cars)
    assert np.median(identity) > 60
    assert (identity < 30).mean() < 0.25
    up_to_half_turn = np.minimum(found, 180 - found)
    assert np.median(up_to_half_turn) < 15
    assert (up_to_half_turn < 30).mean() > 0.9
    assert (found < 30).mean() > 0.5


def test_completions_lie_on_the_scans_and_have_the_size_of_cars(overfitted, cars):
    predictor = overfitted[0]
    for track in cars[:3]:
        done = predictor.complete(track.scans[track.middle])
        size = np.ptp(track.shape, axis=0)
        assert done.warning == ""
        assert 0.7 < done.box.size[0] / size[0] < 1.3
        assert 0.6 < done.box.size[1] / size[1] < 1.5
        centre = track.T_sensor_object[track.middle].translation.numpy()
        assert math.dist(done.box.centre, centre) < 1.0
