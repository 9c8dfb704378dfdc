# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is no vehicle is completed, too: the commands say that it is not to be trusted, and why."""

import json
import shutil

import numpy as np
import pytest
from tests.cars import car_surface

from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.io.poses import read_poses, write_poses
from wildshape.io.rays import write_rays
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply


def _wall(rng):
    plane = rng.uniform((-2.5, -1.7), (2.5, 0.3), (1500, 2))
    return np.column_stack((rng.normal(10, 0.01, 1500), plane))


def _noise(rng):
    return rng.normal((10, 0, -1), 1, (500, 3))


def _pole(rng):
    angle = rng.uniform(np.pi / 2, 3 * np.pi / 2, 300)
    turned = (10 + 0.15 * np.cos(angle), 0.15 * np.sin(angle))
    return np.column_stack((*turned, rng.uniform(-1.7, 1.3, 300)))


def _blob(rng):
    """Half a ball whose bounding box has a diagonal of 20 m: more than trained on, not refused."""
    out = rng.normal(size=(3000, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    half = out[out[:, 0] < 0]
    return 20 * half / np.linalg.norm(np.ptp(half, axis=0)) + (25, 0, 0)


@pytest.fixture(params=(_wall, _noise, _pole, _blob), ids=lambda made: made.__name__[1:])
def no_vehicle(request, tmp_path):
    path = tmp_path / f"{request.param.__name__[1:]}.ply"
    write_ply(path, request.param(np.random.default_rng(0)).astype(np.float32))
    return path


def _reasons(folder):
    records = json.loads(next(folder.rglob("objects.json")).read_text("utf-8"))["scans"]
    return [record["reasons"] for record in records]


@pytest.mark.parametrize("command", ["complete", "register"])
def test_what_is_no_vehicle_is_flagged(wildshape, no_vehicle, tmp_path, command):
    done = wildshape(command, no_vehicle, "--out", tmp_path / "out", "--json")
    assert done.code == 0, done.err
    found = json.loads(done.out)
    assert found["flagged"] == 1
    assert found["reasons"]["low_confidence"] == 1
    assert ("too_large_for_model" in found["reasons"]) == (no_vehicle.stem == "blob")
    assert [sorted(found["reasons"])] == [sorted(one) for one in _reasons(tmp_path / "out")]
    assert "1 of 1 result is not to be trusted: " in done.err
    assert "low confidence 1" in done.err


def test_one_result_alone_says_so_too(wildshape, no_vehicle):
    done = wildshape("complete", no_vehicle, "--out", "-", "--json")
    assert "low_confidence" in json.loads(done.out)["reasons"]
    pair = wildshape("register", no_vehicle, no_vehicle, "--json")
    assert "low_confidence" in json.loads(pair.out)["reasons"]
    assert "not to be trusted" in done.err
    assert "not to be trusted" in pair.err


def test_fused_scans_in_doubt_are_counted(wildshape, no_vehicle, tmp_path):
    track = tmp_path / "track"
    for name in ("0.ply", "1.ply"):
        (track / "scans").mkdir(parents=True, exist_ok=True)
        (track / "scans" / name).write_bytes(no_vehicle.read_bytes())
    done = wildshape("fuse", track, "--out", tmp_path / "fused.ply", "--json")
    found = json.loads(done.out)
    assert found["flagged"] == 2
    assert found["reasons"]["low_confidence"] == 2
    assert "2 of 2 results are not to be trusted" in done.err


def test_a_simulated_car_is_not_flagged(wildshape, cars, tmp_path):
    write_ply(tmp_path / "car.ply", cars[0].scans[0])
    done = wildshape("complete", tmp_path / "car.ply", "--out", tmp_path / "out")
    assert "completed 1 scan of 1 track in" in done.out
    assert "not to be trusted" not in done.err
    assert _reasons(tmp_path / "out") == [[]]
    said = wildshape("complete", tmp_path / "car.ply", "--out", tmp_path / "again", "--json")
    found = json.loads(said.out)
    assert (found["flagged"], found["reasons"]) == (0, {})


def test_few_points_are_a_reason(wildshape, tmp_path):
    write_ply(tmp_path / "few.ply", (car_surface(20)[0] + (10, 0, -1)).astype(np.float32))
    wildshape("complete", tmp_path / "few.ply", "--out", tmp_path / "out")
    assert "few_points" in _reasons(tmp_path / "out")[0]


def test_weights_of_another_sensor_are_doubted_in_a_comparison(wildshape, tmp_path):
    data, words = tmp_path / "tracks", ("--baselines", "none", "--raw", "--out")
    wildshape("simulate", data, "--tracks", "1", "--scans", "2")
    done = wildshape("evaluate", data, *words, tmp_path / "chairs", "--model", "chair")
    assert done.code == 0, done.err
    assert "trained on camera scans, but these are lidar scans" in done.err
    done = wildshape("evaluate", data, *words, tmp_path / "vehicles")
    assert "trained on" not in done.err


@pytest.mark.parametrize("trained", ["tracks", "packed"])
def test_figures_on_what_a_model_was_trained_on_are_doubted(wildshape, tmp_path, trained):
    data, other, run = (tmp_path / name for name in ("tracks", "others", "run"))
    for out, seed in ((data, "1"), (other, "2")):
        wildshape("simulate", out, "--tracks", "2", "--scans", "4", "--seed", seed)
    wildshape("convert", "folder", data, tmp_path / "packed")
    wildshape("train", tmp_path / trained, "--out", run, "--preset", "tiny", "--steps", "2")
    words = ("--baselines", "none", "--raw", "--max-scans", "1", "--model", run, "--out")
    for measured in (data, tmp_path / "packed"):
        done = wildshape("evaluate", measured, *words, tmp_path / f"of-{measured.name}")
        assert done.code == 0, done.err
        assert f"run: was trained on {measured}; these figures say little" in done.err
    done = wildshape("evaluate", other, *words, tmp_path / "else")
    assert "was trained on" not in done.err


def test_shipped_weights_were_not_trained_in_the_folder_one_stands_in(
    wildshape, tmp_path, monkeypatch
):
    wildshape("simulate", tmp_path / "tracks", "--tracks", "1", "--scans", "2")
    monkeypatch.chdir(tmp_path / "tracks")
    words = ("--baselines", "none", "--raw", "--out", tmp_path / "out")
    assert "was trained on" not in wildshape("evaluate", ".", *words).err


def test_figures_of_two_kinds_of_sensor_are_doubted(wildshape, tmp_path):
    """The first track's sensor is that of the weights; the second's was mixed in without a word."""
    (tmp_path / "tracks").mkdir()
    for name, sensor in (("a", "hdl64"), ("b", "depth-camera")):
        words = ("--tracks", "1", "--scans", "2", "--layout", "folders", "--sensor", sensor)
        wildshape("simulate", tmp_path / name, *words)
        (tmp_path / name / "000000").rename(tmp_path / "tracks" / name)
    words = ("--baselines", "identity", "--raw", "--out")
    done = wildshape("evaluate", tmp_path / "tracks", *words, tmp_path / "both")
    assert done.code == 0, done.err
    assert "holds camera and lidar scans, and each figure is of both together" in done.err


def test_rays_of_no_scan_are_doubted(wildshape, dataset, tmp_path):
    track = shutil.copytree(dataset / "000000", tmp_path / "car")
    (track / "rays").mkdir()
    rays = SightLines(np.eye(3, dtype=np.float32), np.full(3, np.inf, np.float32))
    write_rays(track / "rays" / "1.npz", rays)
    done = wildshape("register", track, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    assert "rays/1.npz and all others there are not used" in done.err
    (track / "rays" / "1.npz").rename(track / "rays" / "000001.npz")
    assert "not used" not in wildshape("register", track, "--out", tmp_path / "named").err


def test_scans_out_of_order_are_doubted_by_convert(wildshape, tmp_path):
    for name in ("9", "10"):
        write_ply(
            tmp_path / "raw" / "car" / "scans" / f"{name}.ply",
            np.random.default_rng(1).uniform((9, -1, -1), (12, 1, 0), (100, 3)).astype(np.float32),
        )
    done = wildshape("convert", "folder", tmp_path / "raw", tmp_path / "made", "--json")
    assert done.code == 0, done.err
    assert "car: 10.ply is sorted before 9.ply" in done.err
    (part,) = json.loads(done.out)["parts"]
    assert "car: 10.ply is sorted before 9.ply" in part["doubts"][0]


def test_evaluate_says_that_true_poses_are_the_wrong_way_round(
    wildshape, dataset, trained, tmp_path
):
    data, words = tmp_path / "data", ("--model", trained, "--baselines", "none")
    track = shutil.copytree(dataset / "000000", data / "000000")
    found = wildshape("evaluate", data, "--out", tmp_path / "right", *words)
    assert found.code == 0
    assert "true poses" not in found.err
    write_poses(track / "poses.txt", read_poses(track / "poses.txt").inverse())
    found = wildshape("evaluate", data, "--out", tmp_path / "wrong", *words)
    assert "000000: by its true poses its scans lie " in found.err
    assert "poses.txt holds T_sensor_object" in found.err


def test_evaluate_says_so_of_later_tracks_too(wildshape, dataset, trained, tmp_path):
    for name in ("a", "b", "c", "d"):
        poses = shutil.copytree(dataset / "000000", tmp_path / "data" / name) / "poses.txt"
        if name in "bd":
            write_poses(poses, read_poses(poses).inverse())
    words = ("--model", trained, "--baselines", "none", "--seeds", "2", "--rotate", "yaw")
    found = wildshape("evaluate", tmp_path / "data", "--out", tmp_path / "out", *words)
    assert found.err.count("by its true poses") == 1
    assert "b: by its true poses its scans lie " in found.err
    assert "m off its true shape (1 more track likewise)" in found.err


def test_what_the_model_was_not_made_for_is_said(wildshape, dataset, trained, tmp_path):
    scans = dataset / "000000" / "scans"
    for i in range(2):
        write_ply(tmp_path / "big" / f"{i}.ply", 8 * read_points(scans / f"00000{i}.ply"))
    big = tmp_path / "big"
    model = ("--model", trained)
    found = wildshape("complete", big, "--out", tmp_path / "c", *model, "--json")
    assert json.loads(found.out)["flagged"] == 2
    objects = json.loads((tmp_path / "c" / "big" / "objects.json").read_text())
    assert [scan["confidence"] for scan in objects["scans"]] == [0.0, 0.0]
    assert "outside" in wildshape("fuse", big, "--out", tmp_path / "f.ply", *model).err
    pair = wildshape("register", big / "0.ply", big / "1.ply", *model, "--json")
    assert "outside" in pair.err
    assert json.loads(pair.out)["confidence"] == 0.0
