# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The order in which to look at objects, and the figures that it is by."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.poses import write_poses
from wildshape.io.scans.points import Coordinates
from wildshape.records import Track
from wildshape.report.page.ranking import Judged, index_of, judge, objects_of_scores, worst_first
from wildshape.report.results import TrackResult, chances_of, coordinates_of


def _result(folder: Path, *confidence: float | None, track: Track | None = None) -> TrackResult:
    scans = [{"scan": str(i), "confidence": one} for i, one in enumerate(confidence)]
    return TrackResult(folder, {"scans": scans}, track)


def test_by_cd_then_rotation_then_confidence_and_what_is_not_known_last(tmp_path):
    figures = [(0.3, 1.0, 0.9), (0.1, 40.0, 0.9), (0.1, 5.0, 0.2), (0.1, 5.0, 0.8)]
    figures += [(None, None, 0.1), (None, None, None)]
    ranked = [Judged(_result(tmp_path / str(i)), "", *one) for i, one in enumerate(figures)]
    assert worst_first(reversed(ranked)) == ranked
    assert index_of(ranked, 2).objects == (0, 1, None, None, None, None)


def test_a_scan_without_a_confidence_is_not_the_least_sure(tmp_path):
    result = _result(tmp_path, None, 0.4)
    result.record["scans"][0]["warning"] = "of the unknown one"
    result.record["scans"][1]["warning"] = "of the unsure one"
    assert judge(result).warning == "of the unsure one"


def test_rotation_is_that_of_the_scans_that_have_a_result(tmp_path):
    """Its middle scan is right; the others are 20 and 30 degrees off."""
    wrong = torch.deg2rad(torch.tensor((20.0, 0.0, 30.0))).double()
    truth = SE3(torch.eye(3).double().expand(4, 3, 3), torch.zeros(4, 3).double())
    scans, names = (np.eye(3, dtype=np.float32),) * 4, ("x", "0", "1", "2")
    track = Track("t", scans, names, T_sensor_object=truth)
    write_poses(tmp_path / "poses.txt", SE3(rotation_z(wrong), torch.zeros(3, 3).double()))
    assert judge(_result(tmp_path, 1, 1, 1, track=track)).rotation_deg == pytest.approx(25)
    # One of them is gone from the track: which pose is whose is not known.
    part = track.part([0, 1, 2])
    assert judge(_result(tmp_path, 1, 1, 1, track=part)).rotation_deg is None


def test_an_object_that_was_registered_alone_counts_its_scans(tmp_path):
    one = {"track": "a", "rotation_deg": 3.0, "translation_m": 0.1}
    method = {"name": "m", "completions": [], "registrations": [one, one]}
    (tmp_path / "scores.json").write_text(json.dumps({"runs": [{"methods": [method]}]}))
    table = objects_of_scores(tmp_path / "scores.json", "m")
    assert table is not None
    assert dict(zip(table.columns, table.rows[0], strict=True))["measured"] == 2


def test_objects_registered_alone_are_sorted_by_the_median_rotation(tmp_path):
    found = [("a", 1, 0.1), ("a", 2, 0.2), ("a", 90, 0.9), ("b", 30, 0.5), ("c", 5, 0.4)]
    rows = [{"track": t, "rotation_deg": turn, "translation_m": m} for t, turn, m in found]
    method = {"name": "m", "completions": [], "registrations": rows}
    (tmp_path / "scores.json").write_text(json.dumps({"runs": [{"methods": [method]}]}))
    table = objects_of_scores(tmp_path / "scores.json", "m")
    assert table is not None
    assert table.rows == (
        ("b", 1, "30.0", "0.50"),
        ("c", 1, "5.0", "0.40"),
        ("a", 3, "2.0", "0.20"),
    )


def test_the_worst_cd_of_an_object_is_beside_its_mean(tmp_path):
    errors = [{"precision": 0.1, "coverage": one} for one in (0.1, 0.3)]
    method = {"name": "m", "registrations": []}
    method |= {"completions": [{"track": "a", "error": error} for error in errors]}
    (tmp_path / "scores.json").write_text(json.dumps({"runs": [{"methods": [method]}]}))
    table = objects_of_scores(tmp_path / "scores.json", "m")
    assert table is not None
    assert table.rows == (("a", 2, "0.300", "0.400"),)


def test_a_probability_of_zero_counts_and_one_that_is_not_stated_does_not():
    entries = [{"p_pose": 0.0}, {"p_pose": 1.0}, {"p_pose": None}, {}]
    assert chances_of(entries) == {"heading right": 0.5}


def test_scans_are_read_as_the_results_were_made():
    said = {"unit": "mm", "origin": [1, 2, 3]}
    assert coordinates_of(said) == Coordinates("mm", (1.0, 2.0, 3.0))
