# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a command reads it does not remove, and what it writes it does not take for an input."""

import shutil

import numpy as np
import pytest

from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.io.inputs import open_tracks, with_rays
from wildshape.io.rays import write_rays
from wildshape.io.scans.points import SENSOR_METRES
from wildshape.method.checkpoint import MODEL, weights_file


@pytest.fixture
def run(tmp_path):
    """A folder that looks like a run's."""
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(weights_file(None), folder / MODEL)
    return folder


@pytest.mark.parametrize("command", ["complete", "register", "evaluate"])
def test_overwrite_spares_the_model(refused, store, run, command):
    said = refused(command, store, "--out", run, "--model", run, "--overwrite")
    assert "holds the input" in said
    assert (run / MODEL).is_file()


def test_overwrite_of_a_drive_spares_the_model(refused, run, tmp_path):
    (tmp_path / "scans").mkdir()
    np.ones((50, 4), np.float32).tofile(tmp_path / "scans" / "000000.bin")
    source = tmp_path / "scans"
    assert "holds the input" in refused(
        "drive", source, "--out", run, "--model", run, "--overwrite"
    )
    assert (run / MODEL).is_file()


@pytest.mark.parametrize("plain", [True, False])
def test_a_fused_cloud_is_not_written_among_the_scans(wildshape, refused, tmp_path, plain):
    found = wildshape(
        "simulate", tmp_path / "data", "--tracks", 1, "--scans", 2, "--layout", "folders",
        "--workers", 1,
    )  # fmt: skip
    assert found.code == 0, found
    track = next((tmp_path / "data").glob("*/scans")).parent
    source = track / "scans" if plain else track
    first, last = sorted((track / "scans").iterdir())
    alone = shutil.copy(first, tmp_path / "alone.ply")
    for read, out in (
        (source, track / "scans" / "fused.ply"),
        (first, track / "scans" / "fused.ply"),
        (alone, alone),
        (track, track / "shape.ply"),
        (first, track / "poses.txt"),
    ):
        assert "among the scans" in refused("fuse", read, "--out", out, "--overwrite")
    assert sorted((track / "scans").iterdir()) == [first, last]
    assert wildshape("fuse", source, "--out", tmp_path / "fused.ply").code == 0


def test_rays_of_one_scan_have_the_unit_of_its_track(tmp_path):
    (tmp_path / "scans").mkdir()
    (tmp_path / "track.json").write_text('{"unit": "mm"}')
    points = np.random.default_rng(0).normal((5000, 0, 0), 500, (40, 3))
    np.save(tmp_path / "scans" / "0.npy", points)
    write_rays(tmp_path / "r.npz", SightLines(np.eye(3), np.full(3, 7000.0)))
    for given in (tmp_path / "scans" / "0.npy", tmp_path):
        source = with_rays(open_tracks(given), tmp_path / "r.npz", SENSOR_METRES)
        track = source[0]
        assert track.rays[0] is not None
        assert track.rays[0].ranges == pytest.approx([7.0] * 3)
        assert np.abs(track.scans[0]).max() < 10
