# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An evaluation told apart by kind: each row has the figures of an evaluation of its tracks."""

from dataclasses import replace

import numpy as np
import pytest
from experiments.by_kind import table
from tests.evaluation.scores import completion

from wildshape.evaluation.metrics import RegistrationScore
from wildshape.evaluation.results import MethodScores, Results
from wildshape.evaluation.summary import write_scores
from wildshape.io.store.writer import StoreWriter
from wildshape.records import Track


@pytest.fixture
def measured(tmp_path):
    """Three tracks, and scores of one method that fuses them and one that registers none."""
    with StoreWriter(tmp_path / "data", {}) as store:
        for name, kind in (("a", "van"), ("b", "van"), ("c", "truck")):
            scans = (np.ones((20, 3), np.float32),)
            store.add(Track(name, scans, ("0",), source=f"simulated hdl64 {kind}"))
    fused = [replace(completion(name, 0.1 * n, 0.0), scans=n) for name, n in zip("abc", (1, 3, 2))]
    turned = [RegistrationScore(name, "0", 40.0 * (name == "b"), 0.0, 0.2) for name in "ab"]
    rows = (
        MethodScores("fuses", tuple(fused), tuple(turned), ()),
        MethodScores("alone", tuple(fused), (), ()),
    )
    write_scores(tmp_path / "evaluation", [Results("none", 0, rows)])
    return tmp_path / "data", tmp_path / "evaluation"


def test_a_fused_track_counts_as_often_as_it_has_scans(measured):
    data, evaluation = measured
    lines = table(data, evaluation, "fuses").splitlines()
    assert lines[2] == "| van | 4 | 0.250 | 0.250 | 0.000 | 50.0 | 20.00 | 0.200 |"
    assert lines[3].startswith("| truck | 2 | 0.200 |")


def test_what_registers_nothing_has_no_pose(measured):
    data, evaluation = measured
    for line in table(data, evaluation, "alone").splitlines()[2:]:
        assert [cell.strip() for cell in line.split("|")][-4:-1] == ["\N{EN DASH}"] * 3
