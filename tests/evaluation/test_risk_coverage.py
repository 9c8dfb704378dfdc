# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rank correlation and risk-coverage: by hand, at their extremes, and against scipy."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import spearmanr
from tests.cars import drive_by

from wildshape.evaluation.pictures import draw_confidence, write_figures
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.risk_coverage import rank_correlation, risk_coverage
from wildshape.evaluation.summary import figures_of, write_metrics

TRACKS = [drive_by(name=f"drive {i}", scans=5, seed=i) for i in range(2)]


class Sure:
    """Answers with the scan moved by more and more, and is less and less sure of it."""

    def complete(self, points, sensor):
        return points

    def complete_many(self, scans, sensor):
        return [Spoken(scan + np.float32(i), 1 / (1 + i)) for i, scan in enumerate(scans)]


class Silent:
    """Says nothing of what it thinks of its completions."""

    def complete(self, points, sensor):
        return points


def test_the_order_of_errors_is_all_that_counts():
    error = [0.1, 0.4, 0.2, 0.9]
    assert rank_correlation([9.0, 3.0, 5.0, 1.0], error) == pytest.approx(1)
    assert rank_correlation([0.9, 0.93, 0.91, 0.99], error) == pytest.approx(-1)
    assert rank_correlation([1.0, 1.0, 1.0, 1.0], error) is None
    assert rank_correlation([3.0, 2.0, 1.0], [0.1, 0.2, 0.4]) == pytest.approx(1)
    assert rank_correlation([1.0, 2.0], error[:2]) is None
    assert rank_correlation([], []) is None


@pytest.mark.parametrize("seed", range(5))
def test_equal_to_scipy_with_ties(seed):
    rng = np.random.default_rng(seed)
    confidence, error = rng.integers(0, 6, 40) / 2, rng.integers(0, 9, 40) / 2
    expected = -spearmanr(confidence, error).statistic  # pyright: ignore[reportAttributeAccessIssue]
    assert rank_correlation(confidence.tolist(), error.tolist()) == pytest.approx(expected)


def test_risk_coverage_by_hand():
    curve = risk_coverage([0.9, 0.1, 0.5, 0.7], [1.0, 8.0, 3.0, 2.0])
    assert curve is not None
    assert curve.coverage == (0.25, 0.5, 0.75, 1.0)
    assert curve.risk == pytest.approx((1.0, 1.5, 2.0, 3.5))
    assert curve.area == curve.best_area == pytest.approx((1 + 1.5 + 2 + 3.5) / 4)
    backwards = risk_coverage([0.1, 0.9, 0.5, 0.3], [1.0, 8.0, 3.0, 2.0])
    assert backwards is not None
    assert backwards.risk == pytest.approx((8.0, 5.5, 13 / 3, 3.5))
    assert backwards.best_area == pytest.approx(2.0)


def test_nothing_known_is_the_mean_error_whatever_the_order():
    for error in ([1.0, 2.0, 6.0], [6.0, 1.0, 2.0]):
        curve = risk_coverage([0.5] * 3, error)
        assert curve is not None
        assert curve.risk == pytest.approx((3.0, 3.0, 3.0))
        assert curve.area == pytest.approx(3.0)
    assert risk_coverage([], []) is None


def test_an_evaluation_tells_of_methods_that_state_a_confidence(tmp_path):
    results = run({"sure": Sure(), "silent": Silent()}, TRACKS)
    assert figures_of(results["sure"])["confidence_rank_correlation"] == pytest.approx(1, abs=0.05)
    assert figures_of(results["silent"])["confidence_rank_correlation"] is None
    found = json.loads(write_metrics(tmp_path, [results]).read_text("utf-8"))
    curve = found["risk_coverage"]["sure"]
    assert curve["risk"] == sorted(curve["risk"])
    assert curve["best_area"] <= curve["area"] < curve["risk"][-1]
    assert "silent" not in found["risk_coverage"]
    assert found["methods"]["sure"]["confidence_rank_correlation"] > 0.9


def test_the_figure_is_drawn_where_there_is_something_to_draw(tmp_path):
    results = run({"sure": Sure(), "silent": Silent()}, TRACKS[:1])
    names = {path.name for path in write_figures(tmp_path, results, [])}
    assert names == {"errors.png", "confidence.png"}
    assert draw_confidence(replace(results, methods=results.methods[1:])) is None
