# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Calibration error, Brier score and AUROC, by hand and in the figures of an evaluation."""

from dataclasses import replace

import numpy as np
import pytest
from tests.cars import drive_by
from tests.evaluation.scores import completion

from wildshape.evaluation.calibration import auroc, calibration
from wildshape.evaluation.metrics import BoxScore
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.results import MethodScores
from wildshape.evaluation.summary import figures_of, headings_right
from wildshape.records import Box


def test_by_hand():
    held = calibration([0.9, 0.9, 0.2, 0.2], [True, False, False, False], bins=2)
    assert held is not None
    assert held.error == pytest.approx((abs(0.9 - 0.5) + 0.2) / 2)
    assert held.brier == pytest.approx((0.01 + 0.81 + 0.04 + 0.04) / 4)
    assert held.constant == pytest.approx(0.25 * 0.75)
    assert calibration([], []) is None


def test_equal_probabilities_give_one_figure_in_any_order():
    """Bins of two: 0.5 and 0.5 of three equal ones with one right, then the third and 0.9."""
    expected = (2 * abs(0.5 - 1 / 3) + abs(1.4 - 4 / 3)) / 4
    for true in ([True, False, False], [False, True, False], [False, False, True]):
        held = calibration([0.5, 0.5, 0.5, 0.9], [*true, True], bins=2)
        assert held is not None
        assert held.error == pytest.approx(expected)
        backwards = calibration([0.9, 0.5, 0.5, 0.5], [True, *true], bins=2)
        assert backwards == pytest.approx(held)


def test_true_probabilities_hold():
    rng = np.random.default_rng(0)
    p = rng.uniform(size=20_000)
    held = calibration(p, rng.uniform(size=len(p)) < p)
    assert held is not None
    assert held.error < 0.01
    assert held.brier < 0.75 * held.constant


def test_auroc_counts_pairs():
    assert auroc([0.9, 0.5, 0.5, 0.1], [True, True, False, False]) == pytest.approx(3.5 / 4)
    assert auroc([0.3, 0.2], [True, True]) is None


def test_the_front_is_one_end_for_all():
    turns = (2.0, 175.0, 178.0, 90.0)
    assert headings_right([BoxScore(0.5, turn) for turn in turns]) == [False, True, True, False]


def test_right_is_within_10_degrees_and_0_7_of_the_area_and_bins_are_five():
    """Of ten stated from 0.05 to 0.95 every other one comes true: bins of two, half of each."""
    rows = []
    for number in range(10):
        box = BoxScore(0.5, *((9.9, 0.71) if number % 2 else (10.1, 0.69)))
        stated = number / 10 + 0.05
        rows.append(replace(completion("a", 0.1, 0.1), box=box, p_pose=stated, p_box=stated))
    found = figures_of(MethodScores("m", tuple(rows), (), ()))
    for kind in ("pose", "box"):
        assert found[f"p_{kind}_error"] == pytest.approx((0.4 + 0.2 + 0.0 + 0.2 + 0.4) / 5)
        assert found[f"p_{kind}_brier_constant"] == pytest.approx(0.25)


class Stating:
    """Finds every box of the first track's size where it stands, and states probabilities."""

    def complete(self, points, sensor):
        return points

    def complete_many(self, scans, sensor):
        nowhere = Box((500.0, 0.0, 0.0), (4.0, 2.0, 1.5), (1.0, 0.0, 0.0, 0.0))
        return [Spoken(scan, 0.5, nowhere, p_pose=0.5, p_box=0.25) for scan in scans]


def test_an_evaluation_holds_stated_probabilities():
    results = run({"stating": Stating()}, [drive_by(scans=4, seed=1)])
    found = figures_of(results["stating"])
    assert found["p_box_error"] == pytest.approx(0.25)
    assert found["p_box_brier"] == pytest.approx(0.0625)
    assert found["p_box_brier_constant"] == 0
    assert found["p_pose_error"] is not None
