# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbered examples run, as they stand or on a few tracks; tests/export runs the sixth."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from wildshape.io.scans.points import read_points
from wildshape.io.tracks import write_track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

EXAMPLES = Path(__file__).parent.parent / "examples"
FILES = sorted(EXAMPLES.glob("*.py"))


@pytest.fixture
def example(tmp_path, monkeypatch, capsys):
    """Run an example in an empty folder; what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(number, *arguments):
        path = FILES[number - 1]
        monkeypatch.setattr("sys.argv", [str(path), *map(str, arguments)])
        runpy.run_path(str(path), run_name="__main__")
        return capsys.readouterr().out

    return run


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """Four tracks of four scans."""
    folder = tmp_path_factory.mktemp("folders")
    for track in simulate_tracks(SimulationConfig(tracks=4, scans=4), seed=3, workers=1):
        write_track(folder / track.name, track)
    return folder


def test_there_are_six_short_ones():
    assert [path.name[:3] for path in FILES] == [f"0{i}_" for i in range(1, 7)]
    assert all(len(path.read_text("utf-8").splitlines()) <= 40 for path in FILES)


def test_complete_one_scan(example, tmp_path):
    printed = example(1)
    scan = np.load(EXAMPLES / "scan.npy")
    done = read_points(tmp_path / "completed.ply")
    assert f"{len(scan)} points in, {len(done)} in completed.ply" in printed
    assert np.linalg.norm(done.mean(0) - scan.mean(0)) < 2


def test_register_and_fuse_a_track(example):
    printed = example(2)
    assert float(printed.split()[-2]) < 10  # degrees


def test_a_track_of_one_scan_has_no_error(example, tmp_path):
    one = next(simulate_tracks(SimulationConfig(tracks=1, scans=1), seed=3, workers=1))
    write_track(tmp_path / "one", one)
    assert "median" not in example(2, tmp_path / "one")


def test_train_on_a_folder(example, folders):
    printed = example(3, folders, "run", 2, "tiny")
    assert "step 2: loss" in printed
    assert re.search(r"model.safetensors completes a scan with [1-9]\d+ points", printed)


def test_evaluate_against_baselines(example, folders):
    printed = example(4, folders)
    for row in ("identity", "one-scan", "local-icp", "wildshape"):
        assert f"| {row} | " in printed


def test_boxes_and_a_mesh_of_a_track(example, folders, tmp_path):
    track = sorted(folders.iterdir())[0]
    assert "closed: True" in example(5, track)
    assert {path.name for path in (tmp_path / "boxes").iterdir()} == {"boxes.json", "mesh.glb"}
