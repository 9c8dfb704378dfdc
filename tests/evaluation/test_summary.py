# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import replace

import pytest
from tests.evaluation.scores import completion, scores

from wildshape.evaluation.metrics import RegistrationScore
from wildshape.evaluation.protocol import ONE_SCAN
from wildshape.evaluation.results import (
    MethodScores,
    Results,
    Skipped,
)
from wildshape.evaluation.summary import figures_of, summarise, write_metrics, write_scores
from wildshape.report.page.metrics import metrics_table

FIXED = ["cd", "precision", "coverage", "acc30", "rot_median_deg"]
FIXED += ["trans_median_m", "acc30_sym", "rot_sym_median_deg"]


def test_figures_by_hand():
    figures = figures_of(scores())
    assert figures["cd"] == pytest.approx(0.4)
    assert figures["precision"] == pytest.approx(0.15)
    assert figures["coverage"] == pytest.approx(0.25)
    assert figures["cd_partial"] == pytest.approx(0.2)
    assert figures["acc30"] == pytest.approx(1 / 3)
    assert figures["acc30_sym"] == pytest.approx(2 / 3)
    assert figures["rot_median_deg"] == 40
    assert figures["rot_sym_median_deg"] == 30
    assert figures["trans_median_m"] == pytest.approx(0.2)


def test_shapes_have_means_and_poses_medians():
    """Of three, of which one is far off: the mean is twice the median."""
    shapes = tuple(completion("a", 0.1 * n, 0.2 * n) for n in (1, 1, 4))
    poses = tuple(RegistrationScore("a", "0", 10.0 * n, 5.0 * n, 0.1 * n) for n in (1, 1, 4))
    figures = figures_of(MethodScores("ours", shapes, poses, ()))
    means = {"cd": 0.6, "precision": 0.2, "coverage": 0.4}
    means |= {f"{name}_partial": value / 2 for name, value in means.items()}
    medians = {"rot_median_deg": 10.0, "rot_sym_median_deg": 5.0, "trans_median_m": 0.1}
    for name, value in {**means, **medians}.items():
        assert figures[name] == pytest.approx(value)


def test_mean_and_std_over_seeds():
    runs = [Results("yaw", seed, (scores(scale),)) for seed, scale in enumerate((1, 2, 3))]
    summary = summarise(runs)[0]
    assert summary.mean["cd"] == pytest.approx(0.8)
    assert summary.std["cd"] == pytest.approx(0.4)
    assert summary.std["acc30"] == pytest.approx(0)
    assert summary.per_seed[2]["cd"] == pytest.approx(1.2)
    assert (summary.completions, summary.registrations) == (6, 9)
    assert summary.skipped == {"all points equal": 6}
    assert summarise(runs[:1])[0].std["cd"] is None


def test_metrics_json_has_the_fixed_names(tmp_path):
    bare = MethodScores("pose only", (), scores().registrations, ())
    runs = [Results("yaw", seed, (scores(), bare)) for seed in (0, 5)]
    path = write_metrics(tmp_path / "new", runs, {"command": "wildshape evaluate"})
    content = json.loads(path.read_text())
    assert path.name == "metrics.json"
    assert content["rotate"] == "yaw"
    assert content["provenance"]["command"] == "wildshape evaluate"
    ours = content["methods"]["ours"]
    assert all(isinstance(ours[name], float) for name in FIXED)
    assert set(FIXED) <= set(ours["std"])
    assert set(ours["per_seed"]) == {"0", "5"}
    assert ours["scans_counted"] == {"completion": 4, "registration": 6}
    assert ours["scans_skipped"] == {"all points equal": 4}
    # Named once, however many seeds, with the rows they are missing from.
    assert content["skipped"] == [
        {"track": "a", "scan": "7", "reason": "all points equal", "methods": ["ours"]},
        {"track": "b", "scan": "3", "reason": "all points equal", "methods": ["ours"]},
    ]
    assert content["methods"]["pose only"]["cd"] is None
    every = json.loads(write_scores(tmp_path / "new", runs).read_text())
    assert len(every["runs"]) == 2


def test_a_track_s_one_cloud_counts_as_often_as_the_clouds_of_its_scans():
    """The rows stand in one column: of tracks of 3 and of 1 scan."""
    near, far = completion("a", 0.1, 0.1), completion("b", 0.5, 0.5)
    each = MethodScores("one-scan", (near, near, near, far), (), ())
    whole = MethodScores("identity", (replace(near, scans=3), far), (), ())
    assert figures_of(whole)["cd"] == pytest.approx(figures_of(each)["cd"])
    assert figures_of(whole)["cd"] == pytest.approx((3 * 0.2 + 1.0) / 4)


def test_the_page_counts_shapes_poses_and_each_scan_left_out_once(tmp_path):
    short = tuple(Skipped("c", str(i), f"registration: {ONE_SCAN}") for i in range(5))
    ours = scores()
    runs = [Results("none", 0, (replace(ours, skipped=(*ours.skipped, *short)), scores(name="b")))]
    table = metrics_table(json.loads(write_metrics(tmp_path, runs, {}).read_text()))
    assert [row[-1] for row in table.rows] == ["2 / 3", "2 / 3"]
    assert "2 scans skipped by some method" in table.caption
