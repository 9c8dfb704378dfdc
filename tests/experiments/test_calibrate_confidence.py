# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What probabilities are fitted to: truth of objects, fronts that most agree on, parts left out."""

import math

import numpy as np
from experiments.calibrate_confidence import fit, held
from experiments.trust_data import Known

from wildshape.method.trust import OF_SCAN, ScanFeatures

NAMES = ScanFeatures._fields


def known(seed, count=900):
    """Headings fail where a rival is near, boxes rather at a high cost; every third is no car."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(count, len(NAMES)))
    columns = {name: features[:, place] for place, name in enumerate(NAMES)}
    turn = np.where(columns["rival"] > -0.7, 2.0, 178.0)
    likely = 1 / (1 + np.exp(4 * columns["log_cost"]))
    box = (rng.random(count) < likely).astype(float)
    kind = (np.arange(count) % 3 > 0).astype(float)
    columns["size_off"][:] += 3 * (1 - kind)
    turn[kind == 0] = box[kind == 0] = math.nan
    return Known(features, turn, box, kind, np.arange(count), np.full(count, 100))


def test_fitted_on_some_it_holds_on_others(capsys):
    parts = {f"street{seed}": known(seed) for seed in range(3)}
    calibrator = fit(list(parts.values()), OF_SCAN, NAMES)
    found = held(calibrator, parts, {"real": known(9)}, OF_SCAN)
    for name in ("streets", "real"):
        assert found[name]["pose"]["brier"] < 0.5 * found[name]["pose"]["constant"]
        assert found[name]["kind"]["auroc"] > 0.9
        assert found[name]["box"]["error"] < 0.1
    assert "| streets and real | pose |" in capsys.readouterr().out


def test_the_front_is_the_end_that_most_have():
    one = known(0)
    other = one._replace(turn=180 - one.turn)
    np.testing.assert_array_equal(one.pose, other.pose)
    assert np.isnan(one.pose).sum() == 300
