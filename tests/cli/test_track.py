# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`--track` says that it was used, never mixes with what was made without, and gets its row."""

import json
import shutil

import numpy as np
import pytest

from wildshape.io.poses import read_tum
from wildshape.io.scans.points import read_points


@pytest.fixture(scope="module")
def first_track(dataset):
    return sorted(path for path in dataset.iterdir() if path.is_dir())[0]


@pytest.mark.parametrize("command", ["complete", "register"])
def test_objects_say_what_was_used(wildshape, first_track, trained, tmp_path, command):
    for flags, uses in (((), "scan"), (("--track",), "track")):
        out = tmp_path / uses
        done = wildshape(command, first_track, "--out", out, "--model", trained, *flags)
        assert done.code == 0, done.err
        found = json.loads((out / first_track.name / "objects.json").read_text("utf-8"))
        assert found["uses"] == uses
        assert found["together"] == (uses == "track")


def test_one_shape_is_posed_in_every_scan(wildshape, first_track, trained, tmp_path):
    done = wildshape("complete", first_track, "--out", tmp_path, "--model", trained, "--track")
    assert done.code == 0, done.err
    folder = tmp_path / first_track.name
    poses = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    clouds = [read_points(path) for path in sorted((folder / "completed").iterdir())]
    shapes = [(c - T[:, 3]) @ T[:, :3] for c, T in zip(clouds, poses, strict=True)]
    for shape in shapes[1:]:
        np.testing.assert_allclose(shape, shapes[0], atol=1e-3)


def test_an_output_made_without_is_not_gone_on_with(
    refused, wildshape, first_track, trained, tmp_path
):
    out = tmp_path / "out"
    assert wildshape("complete", first_track, "--out", out, "--model", trained).code == 0
    refused("complete", first_track, "--out", out, "--model", trained, "--track")


def test_fuse_takes_it_and_a_pair_does_not(wildshape, refused, first_track, trained, tmp_path):
    order = ("fuse", first_track, "--out", tmp_path / "fused.ply", "--model", trained, "--track")
    assert json.loads(wildshape(*order, "--json").out)["uses"] == "track"
    scan = next((first_track / "scans").iterdir())
    assert "--track" in refused("register", scan, scan, "--model", trained, "--track")


def test_evaluate_gives_it_a_row(wildshape, store, trained, tmp_path):
    done = wildshape(
        "evaluate", store, "--out", tmp_path / "found", "--model", trained, "--track",
        "--baselines", "none", "--max-scans", 4,
    )  # fmt: skip
    assert done.code == 0, done.err
    found = json.loads((tmp_path / "found" / "metrics.json").read_text("utf-8"))
    rows = found["methods"]
    assert set(rows) == {trained.name, f"{trained.name}, track"}
    assert "all scans" in rows[f"{trained.name}, track"]["about"]
    assert set(found["risk_coverage"]) == set(rows)
    assert (tmp_path / "found" / "confidence.png").is_file()


def test_a_track_registered_together_has_its_trajectory(
    refused, wildshape, first_track, trained, tmp_path
):
    order = ("register", first_track, "--out", tmp_path / "out", "--model", trained)
    done = wildshape(*order, "--track")
    assert done.code == 0, done.err
    folder = tmp_path / "out" / first_track.name
    times, poses = read_tum(folder / "trajectory.tum")
    written = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    np.testing.assert_allclose(poses.matrix[:, :3], written, atol=1e-5)
    found = json.loads((folder / "trajectory.json").read_text("utf-8"))
    assert [row["time"] for row in found["poses"]] == times
    assert found["smoothness"]["translation_p95_m"] >= 0
    refused(*order)
    fused = ("fuse", first_track, "--out", tmp_path / "fused.ply", "--model", trained)
    assert wildshape(*fused, "--track").code == 0


def test_a_scan_that_is_left_out_keeps_its_place_in_the_trajectory(
    wildshape, first_track, trained, tmp_path
):
    track = shutil.copytree(first_track, tmp_path / "named")
    for number, file in enumerate(sorted((track / "scans").iterdir())):
        file.rename(file.with_name(f"scan_{number:02d}.ply"))
    (track / "scans" / "scan_01.ply").write_bytes(b"ply\n")
    (track / "poses.txt").unlink(missing_ok=True)
    done = wildshape("register", track, "--out", tmp_path / "out", "--model", trained)
    assert done.code == 0, done.err
    times, _ = read_tum(tmp_path / "out" / "named" / "trajectory.tum")
    assert times == [0, *range(2, len(times) + 1)]
