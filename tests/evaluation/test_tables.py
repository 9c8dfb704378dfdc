# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tables for people, and the rows that the paper prints."""

import re
from dataclasses import replace

import pytest
from tests.evaluation.scores import completion, scores

from wildshape.evaluation.paper import ABLATION_ROWS, KITTI, LIDAR_ROWS, VIEW_ROWS, VIEW_SEED_ROWS
from wildshape.evaluation.results import MethodScores, Results
from wildshape.evaluation.tables import markdown, paper_markdown, write_table


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
    assert "| 3D vehicle | paper, mean of 5 seeds | 0.260 ± 0.009 |" in text
    lines = [line for line in table.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1


def test_table_says_where_scans_have_truth_of_two_kinds():
    mirrored = replace(completion("a", 0.1, 0.3), partial_points=150)
    known = replace(completion("b", 0.2, 0.4), truth="shape", error_partial=None)
    said = {
        truths: markdown([Results("none", 0, (MethodScores("ours", rows, (), ()),))])
        for truths, rows in {"both": (mirrored, known), "one": (mirrored, mirrored)}.items()
    }
    assert "Truth: mirrored and shape, " in said["both"]
    for table in said.values():
        assert "Mirrored truth is made of the scans" in table
    told = "CD partial is of the scans with mirrored truth alone"
    assert told in said["both"]
    assert told not in said["one"]


def test_paper_rows_add_up():
    """CD = precision + coverage, up to the rounding (and one known slip) of the printed tables."""
    rows = [row for row in (*LIDAR_ROWS, *VIEW_ROWS, *ABLATION_ROWS) if row.method != "DPC-LIDAR"]
    parts = [
        part
        for row in rows
        for part in (
            (row.cd, row.precision, row.coverage),
            (row.cd_partial, row.precision_partial, row.coverage_partial),
        )
    ]
    whole = [known for part in parts if len(known := [n for n in part if n is not None]) == 3]
    assert len(whole) == 28
    for cd, precision, coverage in whole:
        assert cd == pytest.approx(precision + coverage, abs=0.011)
    assert "97.7" in paper_markdown()


def test_the_papers_means_over_seeds_have_its_deviations():
    """Its tables of sensitivity (supplement) print one beside each mean."""
    rows = [
        row for row in (*LIDAR_ROWS, *VIEW_SEED_ROWS) if re.search("mean of 5|3 seeds", row.method)
    ]
    assert len(rows) == 11
    for row in rows:
        figures = [name for name, mean in vars(row).items() if isinstance(mean, float)]
        assert sorted(row.std) == sorted(figures), row
    said = paper_markdown()
    for cell in ("76.5 ± 19.2", "4.21 ± 1.72", "0.200 ± 0.090", "60.6 ± 19.2", "11.54 ± 6.26"):
        assert f"| {cell} |" in said


def test_paper_shapes_of_semantickitti_stand_under_partial_truth():
    """Its supplement says so; beside our real cars CD is against mirrored truth."""
    first, *lines = [line for line in paper_markdown().splitlines() if line.startswith("|")]
    heading = [cell.strip() for cell in first.split("|")]
    rows = [dict(zip(heading, (cell.strip() for cell in line.split("|")))) for line in lines]
    best = next(row for row in rows if row["data"] == KITTI)
    assert [best[name] for name in ("CD, m", "precision", "coverage")] == ["\u2013"] * 3
    parts = ("CD partial", "precision partial", "coverage partial")
    assert [best[name] for name in parts] == ["0.194", "0.087", "0.107"]
