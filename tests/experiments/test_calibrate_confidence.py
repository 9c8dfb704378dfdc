# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What probabilities are fitted to: truth of objects, fronts that most agree on, parts left out."""

import json
import math

import numpy as np
import pytest
import torch
from experiments.calibrate_confidence import Settings, fit, held, main
from experiments.trust_data import Both, Known
from experiments.trust_parts import Parts
from tests.models import CONFIG, SETTINGS

from experiments import calibrate_confidence
from wildshape.errors import BadInputError
from wildshape.io.write_tracks import write_tracks
from wildshape.method.checkpoint import save_checkpoint
from wildshape.method.network import ShapePoseNet
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


def test_what_other_weights_completed_is_not_taken_for_these(cars, tmp_path):
    models = [tmp_path / f"{seed}.safetensors" for seed in range(2)]
    for seed, model in enumerate(models):
        torch.manual_seed(seed)
        save_checkpoint(model, ShapePoseNet(CONFIG).eval(), SETTINGS)
    data = tmp_path / "real"
    tracks = [cars[0].part(range(2))]
    write_tracks(tracks, data, "packed", command="test", settings={})
    one = Parts(tmp_path, models[0])
    np.testing.assert_array_equal(one.real(data).scan.turn, one.real(data).scan.turn)
    for other in (Parts(tmp_path, models[1]), Parts(tmp_path, models[0], share=0.1)):
        with pytest.raises(BadInputError, match=r"real\.npz: was completed by other weights"):
            other.real(data)


@pytest.mark.parametrize("places", [("one/kitti", "other/kitti"), ("hdl64",)])
def test_data_of_one_name_are_not_taken_for_each_other(tmp_path, places):
    check = tuple(tmp_path / place for place in places)
    with pytest.raises(BadInputError, match="other data are called"):
        main(Settings(tmp_path / "out", check=check), "the command")


def test_figures_say_by_which_command_they_are(tmp_path, monkeypatch):
    """Also which data they are of: other calls' are of others."""
    parts = {f"street{seed}": Both(*[known(seed, 90)] * 3) for seed in range(3)}
    monkeypatch.setattr(Parts, "simulated", lambda *_: parts)
    for name in ("OF_SCAN", "OF_TRACK"):
        monkeypatch.setattr(calibrate_confidence, name, OF_SCAN)
    monkeypatch.setattr(calibrate_confidence, "TrackFeatures", ScanFeatures)
    main(Settings(tmp_path), "the command --unseen 45")
    made = json.loads((tmp_path / "trust.json").read_text("utf-8"))
    assert made["provenance"]["command"] == "the command --unseen 45"
    assert made["held"]["scan"]["streets"]["pose"]["n"] == 3 * 60
