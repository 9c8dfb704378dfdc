# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The page of the shipped weights: every row that was measured, made once."""

import json
from dataclasses import replace

import pytest
from experiments.shipped_weights import PAGE, Drives, Settings, drives, page, run  # pyright: ignore

from experiments import shipped_weights  # pyright: ignore


def test_without_the_folders_only_simulated_drives_are_measured(tmp_path, cad):
    alone = [one.name for one in drives(Settings(tmp_path))]
    assert alone == ["procedural", "more", "still-more", "hdl32", "os1-128"]
    names = {one.name for one in drives(Settings(tmp_path, cad, tmp_path / "kitti"))}
    assert names == {*alone, "cad", "kitti"}
    meshes = [path.name for path in (tmp_path / "meshes").iterdir()]
    assert meshes == ["car_blue.ply"], "of split test alone"


@pytest.fixture
def two_sets(monkeypatch):
    """The first set and that of CAD vehicles, few scans of each, measured in two ways."""

    def short(settings):
        for one in drives(settings):
            if one.name in ("procedural", "cad"):
                ways = {key: one.measured[key] for key in ("none", "raw")}
                yield replace(one, made=(*one.made, "--scans", "2"), measured=ways)

    monkeypatch.setattr(shipped_weights, "drives", short)


def test_the_page_has_every_row_and_is_made_once(two_sets, tmp_path, cad, half_written):
    """What a stop left is made again, and what other weights were measured to be."""
    half_written(tmp_path / "share-0.01" / "cad")
    settings = Settings(tmp_path, cad, share=0.01)
    run(settings, "the command")
    text = (tmp_path / "share-0.01" / PAGE).read_text("utf-8")
    first, second = text.split("\n## ")[1:]
    for name in ("identity", "one-scan", "local-icp", "wildshape", "wildshape, track"):
        assert f"\n| {name} | " in first
        assert f"\n| {name} | " in second
    assert "\n| wildshape, not refined | " in first
    assert "\n| car | 4 | " in second, "by kind"
    assert "the command" in text
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("metrics.json")}
    assert len(made) == 4
    run(settings, "the command")
    assert {path: path.stat().st_mtime_ns for path in made} == made
    other = tmp_path / "share-0.01" / "procedural-raw"
    record = json.loads((other / "wildshape.json").read_text("utf-8"))
    record["settings"]["models"] = ["0123456789abcdef"]
    (other / "wildshape.json").write_text(json.dumps(record), "utf-8")
    run(settings, "the command")
    new = {path.parent for path in made if path.stat().st_mtime_ns != made[path]}
    assert new == {other}


def test_the_page_says_where_the_code_that_measured_had_changes(tmp_path):
    (tmp_path / "some-none").mkdir()
    made = {"code": f"{'0f' * 20} with changes", "time_utc": "2026-11-30", "hardware": {"cpu": "x"}}
    found = json.dumps({"methods": {}, "provenance": made})
    (tmp_path / "some-none" / "metrics.json").write_text(found, "utf-8")
    some = Drives("some", "Some", (), {"none": ()})
    assert "Measured at commit 0f0f0f0 with changes, 2026-11-30, x. " in page(tmp_path, [some], "")
