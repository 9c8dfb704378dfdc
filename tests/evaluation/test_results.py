# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json

import numpy as np
import pytest
from tests.cars import drive_by

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.identity import OneScan
from wildshape.baselines.pairs import Chained
from wildshape.evaluation.examples import gather, pick
from wildshape.evaluation.metrics import CompletionError, RegistrationScore
from wildshape.evaluation.paper import ABLATION_ROWS, LIDAR_ROWS, VIEW_ROWS
from wildshape.evaluation.pictures import draw_errors, draw_examples, project, write_figures
from wildshape.evaluation.protocol import run
from wildshape.evaluation.results import (
    CompletionScore,
    MethodScores,
    Results,
    Skipped,
)
from wildshape.evaluation.summary import figures_of, summarise, write_metrics, write_scores
from wildshape.evaluation.tables import markdown, paper_markdown, write_table

FIXED = ["cd", "precision", "coverage", "acc30", "rot_median_deg"]
FIXED += ["trans_median_m", "acc30_sym", "rot_sym_median_deg"]


def completion(track, precision, coverage):
    partial = CompletionError(precision / 2, coverage / 2)
    error = CompletionError(precision, coverage)
    return CompletionScore(track, "0", error, partial, "mirrored", 100, 200, 0.05)


def scores(scale=1.0, name="ours"):
    return MethodScores(
        name,
        (completion("a", 0.1 * scale, 0.3 * scale), completion("b", 0.2 * scale, 0.2 * scale)),
        (
            RegistrationScore("a", "0", 30.0, 30.0, 0.1 * scale),
            RegistrationScore("a", "1", 170.0, 10.0, 0.2 * scale),
            RegistrationScore("b", "0", 40.0, 40.0, 0.6 * scale),
        ),
        (Skipped("a", "7", "all points equal"), Skipped("b", "3", "all points equal")),
    )


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


def test_table_shows_every_row_what_was_left_out_and_the_paper_apart(tmp_path):
    runs = [Results("yaw", seed, (scores(scale),)) for seed, scale in enumerate((1, 2, 3))]
    table = markdown(runs)
    assert "| ours | 0.800 ± 0.400 |" in table
    assert "33.3 ± 0.0" in table
    assert "6 x all points equal" in table
    assert "200 points" in table
    text = write_table(tmp_path, runs).read_text()
    assert "SemanticKITTI" not in table
    assert "other data" in text
    assert "| SemanticKITTI | paper, mean of 5 seeds | 0.200 |" in text
    lines = [line for line in table.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1


def test_paper_rows_add_up():
    """CD = precision + coverage, up to the rounding (and one known slip) of the printed tables."""
    rows = (*LIDAR_ROWS, *VIEW_ROWS, *ABLATION_ROWS)
    whole = [row for row in rows if row.precision is not None and row.method != "DPC-LIDAR"]
    assert len(whole) == 28
    for row in whole:
        assert row.cd == pytest.approx(row.precision + row.coverage, abs=0.011)
    assert "97.7" in paper_markdown()


def test_examples_are_picked_by_error():
    rows = tuple(completion(name, cd, 0.0) for name, cd in zip("abcde", (0.5, 0.1, 0.9, 0.2, 0.3)))
    extra = completion("a", 0.1, 0.0)  # The mean of a is 0.3: a tie with e, settled by name.
    chosen = pick(MethodScores("m", (*rows, extra), (), ()))
    assert {label: name for label, (name, _) in chosen.items()} == {
        "best": "b",
        "median": "a",
        "worst": "c",
    }
    assert pick(MethodScores("m", (), (), ())) == {}


class Method(OneScan, Chained):
    def __init__(self):
        Chained.__init__(self, LocalIcp())


def test_examples_and_figures(tmp_path):
    tracks = [drive_by(f"t{i}", scans=3, points=100 + 50 * i, seed=i) for i in range(4)]
    results = run({"m": Method()}, tracks, "so3", seed=3)
    examples = gather(tracks, results, "m", Method())
    assert [e.label for e in examples] == ["best", "median", "worst"]
    assert examples[0].cd <= examples[1].cd <= examples[2].cd
    for example in examples:
        # Back in the object's frame although the input was turned.
        assert np.abs(example.scan).max(axis=0) == pytest.approx([2.1, 0.85, 0.75], abs=0.15)
        assert example.fused is not None
    paths = write_figures(tmp_path, results, examples)
    assert [p.name for p in paths] == ["errors.png", "examples.png"]
    assert all(p.read_bytes()[:4] == b"\x89PNG" for p in paths)
    assert len(draw_examples(examples).axes) == 3 * 4
    beside = gather(tracks, results, "m", Method(), rival=Chained(LocalIcp()))
    icp, ours = beside[0].rival, examples[0].fused
    assert icp is not None
    assert ours is not None
    assert np.array_equal(icp, ours)  # the same ICP
    assert len(draw_examples(beside).axes) == 3 * 5


def test_drawing_keeps_aspect_and_survives_gaps():
    tracks = [drive_by(scans=2, points=60)]
    results = run({"scan": OneScan()}, tracks)
    examples = gather(tracks, results, "scan", OneScan())
    assert examples[0].fused is None
    figure = draw_examples(examples)
    assert all(ax.get_aspect() == 1.0 for ax in figure.axes)
    assert len(draw_errors(Results("none", 0, ())).axes) == 2


def test_projection_is_orthographic():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3)).astype(np.float32)
    lengths = np.linalg.norm(project(points), axis=1)
    assert lengths == pytest.approx(np.linalg.norm(points, axis=1), rel=1e-5)
    assert project(np.array([[0, 0, 1]], np.float32))[0, 1] > 0.9
