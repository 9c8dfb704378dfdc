# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`complete`: the rays of a scan reach the result; what cannot be used is refused or said."""

import errno
import json
import shutil

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

import wildshape as library
from wildshape.inference.folders import complete_folder
from wildshape.io.rays import read_rays
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply


@pytest.fixture
def hidden(wildshape, tmp_path):
    """A track of two scans, something in front of the car, with rays."""
    asked = ("--tracks", 1, "--scans", 2, "--seed", 4, "--occlusion", 0.999, "--rays")
    done = wildshape("simulate", tmp_path / "data", *asked, "--layout", "folders", "--workers", 1)
    assert done.code == 0, done.err
    return next((tmp_path / "data").glob("*/track.json")).parent


def test_the_rays_of_a_file_are_those_of_the_library(wildshape, refused, hidden, tmp_path):
    scan, rays = (next(iter(sorted(hidden.glob(kind)))) for kind in ("scans/*", "rays/*.npz"))
    alone = library.load().complete(scan)
    under = library.load().complete(scan, rays=read_rays(rays))
    assert abs(under.box.size[0] - alone.box.size[0]) > 0.1
    done = wildshape("complete", scan, "--rays", rays, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    (record,) = json.loads(next((tmp_path / "out").rglob("objects.json")).read_text())["scans"]
    assert record["cost_m"] == pytest.approx(under.cost, abs=1e-3)
    assert record["p_pose"] == pytest.approx(under.p_pose, abs=1e-2)
    said = refused("complete", hidden, "--rays", rays, "--out", tmp_path / "all")
    assert "holds 2; keep those of a track in its folder rays/" in said


@pytest.fixture
def scan(dataset):
    return read_points(dataset / "000000" / "scans" / "000000.ply")


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda scan: scan[:0], "0 finite points"),
        (lambda scan: scan[:15], "15 finite points"),
        (lambda scan: np.repeat(scan[:1], 100, 0), "all 100 points are equal"),
        (lambda scan: 1000 * scan, "--unit mm"),
        (lambda scan: scan / 1000, "at least"),
    ],
)
def test_bad_scans(refused, scan, trained, tmp_path, spoil, reason):
    path = tmp_path / "bad.npy"
    np.save(path, spoil(scan))
    said = refused("complete", path, "--out", tmp_path / "c", "--model", trained)
    assert str(path) in said
    assert reason in said
    assert not (tmp_path / "c").exists() or not list((tmp_path / "c").glob("*/*"))


def test_unit_cures(wildshape, scan, trained, tmp_path):
    write_ply(tmp_path / "mm.ply", 1000 * scan)
    out = tmp_path / "c"
    found = wildshape(
        "complete", tmp_path / "mm.ply", "--out", out, "--model", trained, "--unit", "mm"
    )
    assert found.code == 0
    completed = read_points(out / "mm" / "completed" / "mm.ply")
    assert np.linalg.norm(completed.mean(0) - scan.mean(0)) < 5.0


def test_a_dataset_goes_on_without_bad_scans(wildshape, dataset, trained, tmp_path):
    data = shutil.copytree(dataset, tmp_path / "data")
    write_ply(data / "000000" / "scans" / "000001.ply", np.zeros((3, 3), np.float32))
    for file in (data / "000002" / "scans").iterdir():
        file.write_bytes(b"ply\n")
    found = wildshape("complete", data, "--out", tmp_path / "c", "--model", trained, "--json")
    assert found.code == 0
    said = json.loads(found.out)
    assert (said["tracks"], said["scans"]) == (5, 29)
    what = {entry["what"] for entry in said["skipped"]}
    assert {"000000/000001.ply", "000002"} <= what
    assert "000000/000001.ply: " in found.err
    objects = json.loads((tmp_path / "c" / "000000" / "objects.json").read_text())
    assert [entry["scan"] for entry in objects["skipped"]] == ["000001.ply"]
    assert len((tmp_path / "c" / "000000" / "poses.txt").read_text().splitlines()) == 5


def test_points_that_are_not_finite_are_dropped_and_said_once(wildshape, scan, trained, tmp_path):
    scan[:7] = np.nan
    np.save(tmp_path / "nan.npy", scan)
    found = wildshape("complete", tmp_path / "nan.npy", "--out", tmp_path / "c", "--model", trained)
    assert found.code == 0
    assert found.err.count("dropped 7 points") == 1
    np.save(tmp_path / "whole.npy", scan[7:])
    pair = wildshape("register", tmp_path / "whole.npy", tmp_path / "nan.npy", "--model", trained)
    assert pair.code == 0
    assert pair.err.startswith(f"{tmp_path / 'nan.npy'}: dropped 7 points")
    assert pair.err.count("dropped") == 1


@pytest.mark.parametrize(
    ("header", "body"),
    [
        ("element vertex 1000000000\nproperty float x\nproperty float y\nproperty float z", 120),
        ("element vertex 100\nproperty float x\nproperty float y\nproperty float z", 60),
        ("element vertex 10\nproperty quad x\nproperty float y\nproperty float z", 120),
        ("element vertex -5\nproperty float x\nproperty float y\nproperty float z", 120),
    ],
)
def test_damaged_file(refused, trained, tmp_path, header, body):
    path = tmp_path / "bad.ply"
    text = f"ply\nformat binary_little_endian 1.0\n{header}\nend_header\n"
    path.write_bytes(text.encode() + bytes(body))
    assert str(path) in refused("complete", path, "--out", tmp_path / "c", "--model", trained)


def test_poses(refused, dataset, trained, tmp_path):
    track = shutil.copytree(dataset / "000000", tmp_path / "track")
    command = ("complete", track, "--out", tmp_path / "c", "--model", trained)
    lines = (track / "poses.txt").read_text().splitlines()
    (track / "poses.txt").write_text("\n".join(lines[:-1]) + "\n")
    assert str(track / "poses.txt") in refused(*command)
    lines[2] = "2 0 0 1 0 2 0 1 0 0 2 1"
    (track / "poses.txt").write_text("\n".join(lines) + "\n")
    said = refused(*command)
    assert "3" in said
    assert "8" in said  # line and determinant


def test_checkpoint(refused, dataset, trained, tmp_path):
    model = tmp_path / "bad.safetensors"
    command = ("complete", dataset, "--out", tmp_path / "c", "--model", model)
    assert "no such checkpoint" in refused(*command)
    model.write_bytes(b"no tensors at all")
    assert str(model) in refused(*command)
    weights = load_file(trained / "model.safetensors")
    with safe_open(trained / "model.safetensors", framework="pt") as file:
        metadata = file.metadata()
    save_file(weights, model, {**metadata, "version": "99"})
    said = refused(*command)
    assert "expected" in said
    assert "99" in said
    name = next(iter(weights))
    save_file({k: v for k, v in weights.items() if k != name}, model, metadata)
    assert name in refused(*command)
    assert not (tmp_path / "c").exists()


def test_output_of_other_settings_is_not_mixed_in(refused, dataset, trained, tmp_path):
    out = tmp_path / "c"
    out.mkdir()
    marker = {"command": "complete", "status": "running", "settings": {"input": "other"}}
    (out / "wildshape.json").write_text(json.dumps(marker))
    command = ("complete", dataset, "--out", out, "--model", trained)
    assert "unfinished output" in refused(*command)
    (out / "wildshape.json").write_text(json.dumps(marker | {"status": "finished"}))
    assert "with other settings" in refused(*command)


def test_full_disk(wildshape, dataset, trained, tmp_path, monkeypatch):
    write = complete_folder.write_cloud

    def full(path, points):
        if path.name == "000002.ply":
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        write(path, points)

    command = ("complete", dataset, "--out", tmp_path / "c", "--model", trained)
    with monkeypatch.context() as patch:
        patch.setattr(complete_folder, "write_cloud", full)
        found = wildshape(*command)
    assert found.code == 1
    assert "no space left" in found.err
    assert found.err.count("\n") == 1
    assert wildshape(*command).code == 0
    assert len(list((tmp_path / "c").glob("*/completed/*.ply"))) == 36


def test_folder_that_cannot_be_written(refused, dataset, trained, tmp_path):
    (tmp_path / "file").write_text("mine")
    out = ("--out", tmp_path / "file" / "c", "--model", trained)
    assert "check the path" in refused("complete", dataset, *out)


def test_control_characters_of_a_file_do_not_reach_the_terminal(refused, trained, tmp_path):
    path = tmp_path / "bad.pcd"
    path.write_bytes(b"\x1b[2J\x07 VERSION")
    said = refused("complete", path, "--out", tmp_path / "c", "--model", trained)
    assert "\x1b" not in said


def test_what_an_earlier_run_left_out_is_no_text(wildshape, hidden, trained, tmp_path):
    """A traceback in a run that was gone on with."""
    line = "complete", hidden, "--out", tmp_path / "c", "--model", trained
    assert wildshape(*line).code == 0
    (objects,), marker = (tmp_path / "c").glob("*/objects.json"), tmp_path / "c" / "wildshape.json"
    for path, changed in ((marker, {"status": "running"}), (objects, {"skipped": "x"})):
        path.write_text(json.dumps(json.loads(path.read_text()) | changed))
    found = wildshape(*line)
    assert found.code == 2
    assert f"{objects}: expected what an earlier run wrote" in found.err
