# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A logistic regression finds the law that it was shown, and its probabilities come true."""

import math

import numpy as np
import pytest

from wildshape.method.trust import (
    USUAL_SIZES_M,
    LogisticRegression,
    Probabilities,
    fit_logistic,
    size_off,
)

NAMES = ("cost", "points", "free")


def shown(count=4000, seed=0):
    """Features, one known of every other row, and what came true by a law."""
    rng = np.random.default_rng(seed)
    known = rng.normal(size=(count, 3)) * (1.0, 20.0, 0.1) + (0.0, 100.0, 0.0)
    odds = 1.0 - 2.0 * known[:, 0] + 0.05 * (known[:, 1] - 100.0)
    known[::2, 2] = np.nan
    return known, rng.uniform(size=count) < 1 / (1 + np.exp(-odds))


def test_the_law_is_found_and_comes_true():
    found = fit_logistic(NAMES, *shown())
    weights = dict(zip(NAMES, found.weights, strict=True))
    assert weights["cost"] == pytest.approx(-2.0, abs=0.2)
    assert weights["points"] == pytest.approx(0.05, abs=0.01)
    assert found.usual[1] == pytest.approx(100.0, abs=1.0)
    known, true = shown(seed=1)
    stated = np.array([found(dict(zip(NAMES, row, strict=True))) for row in known.tolist()])
    for part in np.array_split(np.argsort(stated), 5):
        assert stated[part].mean() == pytest.approx(true[part].mean(), abs=0.05)


def test_what_is_unknown_counts_as_usual():
    line = LogisticRegression(("cost", "free"), (1.0, -3.0), (0.0, 0.2), bias=0.5)
    usual = line({"cost": 1.0, "free": 0.2, "more": 7.0})
    assert usual == pytest.approx(1 / (1 + math.exp(-1.5)))
    assert line({"cost": 1.0, "free": math.nan}) == usual
    assert line({"cost": 1.0, "free": 0.7}) < usual
    assert 0 < line({"cost": -1e9, "free": 1e9}) < 1e-9


def test_a_law_without_exception_stays_finite():
    known = np.linspace(-1, 1, 40)[:, None]
    found = fit_logistic(("cost",), known, known[:, 0] < 0)
    assert all(map(math.isfinite, (*found.weights, found.bias)))
    assert found({"cost": -1.0}) > 0.9 > 0.1 > found({"cost": 1.0})


def test_sizes_and_products():
    assert [size_off(size) for size in USUAL_SIZES_M] == [0.0] * len(USUAL_SIZES_M)
    assert size_off((12.0, 0.4, 3.0)) > size_off((5.0, 1.9, 1.6)) > 0
    assert math.isfinite(size_off((0.0, 0.0, 0.0)))
    assert Probabilities(0.5, 0.4, 0.1).product == pytest.approx(0.02)
