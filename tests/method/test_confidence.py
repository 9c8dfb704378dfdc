# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A calibration finds the law that it was shown, is a probability, and travels with the weights."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from tests.models import CONFIG, SETTINGS, scan

from wildshape.inference.predictor import Predictor, load
from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.method.confidence import Calibration, ConfidenceFeatures, fit_calibration
from wildshape.method.network import ShapePoseNet


def shown(count=800, seed=0):
    """Features, and Chamfer distances that grow with cost and fall with points, 20 % of chance."""
    rng = np.random.default_rng(seed)
    features = [
        ConfidenceFeatures(*row)
        for row in rng.normal(size=(count, len(ConfidenceFeatures._fields)))
    ]
    law = np.asarray([-1.5 + 0.4 * f.log_cost - 0.2 * f.log_points for f in features])
    return features, np.exp(law + rng.normal(scale=0.2, size=count))


def test_the_law_is_found():
    features, cd = shown()
    found = fit_calibration(features, cd)
    weights = dict(zip(ConfidenceFeatures._fields, found.weights, strict=True))
    assert weights.pop("log_cost") == pytest.approx(0.4, abs=0.03)
    assert weights.pop("log_points") == pytest.approx(-0.2, abs=0.03)
    assert max(abs(w) for w in weights.values()) < 0.03
    assert found.sigma == pytest.approx(0.2, rel=0.1)
    assert found.within_m == pytest.approx(float(np.median(cd)))


def test_what_is_stated_is_the_share_of_good_completions():
    found = fit_calibration(*shown())
    features, cd = shown(seed=1)
    stated = np.asarray([found.confidence(f) for f in features])
    assert 0 <= stated.min() <= stated.max() <= 1
    for part in np.array_split(np.argsort(stated), 4):
        assert stated[part].mean() == pytest.approx(np.mean(cd[part] <= found.within_m), abs=0.1)


def test_a_half_where_the_line_meets_the_bar():
    found = Calibration((1.0, *[0.0] * 9), bias=math.log(0.2), sigma=0.3, within_m=0.2)
    nothing = ConfidenceFeatures(*[0.0] * 10)
    assert found.expected(nothing) == pytest.approx(0.2)
    assert found.confidence(nothing) == pytest.approx(0.5)
    assert found.confidence(nothing._replace(log_cost=0.3)) == pytest.approx(0.1587, abs=1e-4)


def test_a_fact_that_never_changes_does_no_harm():
    features, cd = shown(60)
    same = [f._replace(entropy=0.0, margin=0.0) for f in features]
    found = fit_calibration(same, cd)
    assert all(math.isfinite(w) for w in found.weights)
    assert 0 < found.confidence(same[0]) < 1


def test_a_calibration_travels_with_the_weights(tmp_path):
    torch.manual_seed(0)
    network = ShapePoseNet(CONFIG).eval()
    calibration = fit_calibration(*shown(60), "somewhere")
    settings = dataclasses.replace(SETTINGS, calibration=calibration)
    save_checkpoint(tmp_path / "model.safetensors", network, settings)
    _, found = load_checkpoint(tmp_path / "model.safetensors")
    assert found.calibration == calibration
    done = load(tmp_path / "model.safetensors").complete(scan())
    assert done.confidence == calibration.confidence(ConfidenceFeatures(*done.features))


def test_without_one_it_is_the_cost_that_decides():
    torch.manual_seed(0)
    done = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS).complete(scan())
    features = ConfidenceFeatures(*done.features)
    assert done.confidence == pytest.approx(1 / (1 + (done.cost / SETTINGS.cost_m[1]) ** 2))
    assert math.exp(features.log_cost) == pytest.approx(done.cost)
    assert 0 <= features.entropy <= math.log(4) + 1e-6
    assert features.margin >= 0
    assert features.spread >= 0
    assert 0 <= features.covered <= 1
    assert features.log_points == pytest.approx(math.log(200))
