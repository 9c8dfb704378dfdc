# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
from dataclasses import asdict

import numpy as np
import pytest
import torch
from tests.cars import poses_of

from wildshape.inference.config import InferenceConfig
from wildshape.io.scans.points import read_points
from wildshape.io.store.store import open_store
from wildshape.io.tracks import read_poses, read_track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


def test_simulate_depends_on_the_seed_alone(wildshape, store, tmp_path):
    make = ("--tracks", 6, "--scans", 6, "--workers", 1, "--json")
    said = json.loads(wildshape("simulate", tmp_path / "same", *make, "--seed", 3).out)
    wildshape("simulate", tmp_path / "other", *make, "--seed", 4)
    same, other = open_store(tmp_path / "same"), open_store(tmp_path / "other")
    assert same.fingerprint == open_store(store).fingerprint != other.fingerprint
    assert (said["tracks"], said["scans"]) == (6, len(same.scan_sizes))


def test_folders_and_packed_hold_the_same(wildshape, store, dataset, tmp_path):
    assert wildshape("convert", "folder", dataset, tmp_path / "again").code == 0
    before, after = open_store(store), open_store(tmp_path / "again")
    assert after.names == before.names
    for old, new in zip(before, after):
        assert new.scan_names == old.scan_names
        assert all(np.array_equal(a, b) for a, b in zip(old.scans, new.scans))
        torch.testing.assert_close(poses_of(new).matrix, poses_of(old).matrix)


def test_complete_a_dataset(wildshape, dataset, trained, tmp_path):
    found = wildshape("complete", dataset, "--out", tmp_path / "c", "--model", trained, "--json")
    said = json.loads(found.out)
    assert (said["tracks"], said["scans"], said["skipped"]) == (6, 36, [])
    for folder in sorted(dataset.glob("0*")):
        track, out = read_track(folder), tmp_path / "c" / folder.name
        poses, objects = (
            read_poses(out / "poses.txt"),
            json.loads((out / "objects.json").read_text()),
        )
        assert len(poses) == len(track.scans) == len(objects["scans"])
        assert objects["together"] is False
        assert objects["inference"] == json.loads(json.dumps(asdict(InferenceConfig())))
        for i, entry in enumerate(objects["scans"]):
            assert entry["scan"] == track.scan_names[i]
            shape = read_points(out / "completed" / f"{entry['scan']}.ply")
            assert np.linalg.norm(shape.mean(0) - track.scans[i].mean(0)) < 5.0
            check_entry(entry, shape, poses[i])
    assert json.loads((tmp_path / "c" / "wildshape.json").read_text())["status"] == "finished"


def check_entry(entry, shape, T_sensor_canonical):
    box = entry["box"]
    w, x, y, z = box["quaternion_wxyz"]
    assert abs(w * w + x * x + y * y + z * z - 1) < 1e-4
    R = rotation(w, x, y, z)
    inside = np.abs((shape - box["centre"]) @ R) <= np.asarray(box["size"]) / 2 + 1e-3
    assert inside.all(1).mean() > 0.9
    assert 0 <= entry["confidence"] <= 1
    assert entry["seconds"] > 0
    assert entry["cost_m"] > 0
    assert isinstance(entry["refined"], bool)
    assert T_sensor_canonical.rotation.det().item() == pytest.approx(1, abs=1e-5)


def rotation(w, x, y, z):
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_complete_one_scan_and_a_store(wildshape, dataset, store, trained, tmp_path):
    scan = sorted((dataset / "000001" / "scans").iterdir())[2]
    assert wildshape("complete", scan, "--out", tmp_path / "one", "--model", trained).code == 0
    alone = read_points(tmp_path / "one" / scan.stem / "completed" / f"{scan.stem}.ply")
    model = trained / "model.safetensors"
    assert wildshape("complete", store, "--out", tmp_path / "all", "--model", model).code == 0
    among = read_points(tmp_path / "all" / "000001" / "completed" / f"{scan.stem}.ply")
    np.testing.assert_allclose(alone, among, atol=1e-4)


def test_register_two_scans(wildshape, dataset, trained):
    a, b = sorted((dataset / "000000" / "scans").iterdir())[:2]
    same = json.loads(wildshape("register", a, a, "--model", trained, "--json").out)
    np.testing.assert_allclose(same["T_target_source"], np.eye(4), atol=1e-5)
    assert same["inlier_ratio"] == 1.0
    there = json.loads(wildshape("register", a, b, "--model", trained, "--json").out)
    back = json.loads(wildshape("register", b, a, "--model", trained, "--json").out)
    product = np.asarray(there["T_target_source"]) @ back["T_target_source"]
    np.testing.assert_allclose(product, np.eye(4), atol=1e-5)
    text = wildshape("register", a, b, "--model", trained).out
    assert text.startswith("T_target_source\n")
    assert "inlier ratio" in text


def test_register_doubts_scans_that_hardly_meet(wildshape, tmp_path):
    """A car's front as it comes and its rear as it goes, by the shipped weights."""
    *_, drive = simulate_tracks(SimulationConfig(tracks=2, scans=12), 1, workers=1)
    for name, scan in (("front", 5), ("near", 6), ("like", 7), ("rear", 11)):
        np.save(tmp_path / f"{name}.npy", drive.scans[scan])

    def said(one, other):
        done = wildshape("register", tmp_path / f"{one}.npy", tmp_path / f"{other}.npy")
        assert done.code == 0, done
        return done.err

    assert "hardly any points lie on each other" in said("front", "rear")
    assert "hardly any points lie on each other" not in said("like", "near")


def test_register_a_track(wildshape, refused, dataset, trained, tmp_path):
    out = tmp_path / "r"
    assert wildshape("register", dataset / "000000", "--out", out, "--model", trained).code == 0
    T_sensor_can = read_poses(out / "000000" / "poses.txt")
    T_middle_scan = read_poses(out / "000000" / "T_middle_scan.txt")
    expected = T_sensor_can[3] @ T_sensor_can.inverse()
    torch.testing.assert_close(T_middle_scan.matrix, expected.matrix, atol=1e-4, rtol=0)
    assert len(list((out / "000000" / "completed").glob("*.ply"))) == len(T_sensor_can)
    assert "--out" in refused("register", dataset)
    refused("register", dataset / "000000", dataset / "000001", "--model", trained)


def test_fuse(wildshape, refused, dataset, trained, tmp_path):
    track = read_track(dataset / "000000")
    for name in ("f.ply", "f.npy", "f.xyz"):
        out = tmp_path / name
        assert wildshape("fuse", dataset / "000000", "--out", out, "--model", trained).code == 0
        assert len(read_points(out)) == sum(len(scan) for scan in track.scans)
    assert "6 tracks" in refused("fuse", dataset, "--out", tmp_path / "g.ply", "--model", trained)
    assert ".stl" in refused("fuse", dataset / "000000", "--out", tmp_path / "g.stl")
    assert "--overwrite" in refused("fuse", dataset / "000000", "--out", tmp_path / "f.ply")


def test_evaluate_and_report(wildshape, refused, store, trained, tmp_path):
    out = tmp_path / "e"
    measure = ("evaluate", store, "--out", out, "--rotate", "yaw", "--seeds", 2, "--max-scans", 3)
    found = wildshape(*measure, "--model", trained)
    assert found.code == 0
    assert "| local-icp |" in found.out
    metrics = json.loads((out / "metrics.json").read_text())
    assert list(metrics["methods"]) == ["identity", "local-icp", "tiny"]
    assert set(metrics["methods"]["tiny"]["per_seed"]) == {"0", "1"}
    assert metrics["provenance"]["settings"]["rotate"] == "yaw"
    for name in ("table.md", "errors.png", "examples.png", "scores.json"):
        assert (out / name).stat().st_size > 0
    assert wildshape("report", out).code == 0
    assert "<html" in (out / "report.html").read_text("utf-8")[:300]
    assert "--overwrite" in refused("report", out)


def test_evaluate_models_as_seeds(wildshape, refused, store, trained, tmp_path):
    other = tmp_path / "second.safetensors"
    other.write_bytes((trained / "model.safetensors").read_bytes())
    measure = ("evaluate", store, "--out", tmp_path / "e", "--max-scans", 2, "--as-seeds", "--json")
    models = ("--baselines", "none", "--model", trained, other)
    assert "two models or more" in refused(*measure, *models[:-1])
    found = wildshape(*measure, *models, "--seeds", 3)
    assert "--as-seeds: each model is measured once" in found.err
    methods = json.loads(found.out)["methods"]
    assert len(methods["wildshape"]["per_seed"]) == 2
    assert methods["wildshape"]["std"]["cd"] == 0.0
    (selected,) = set(methods) - {"wildshape"}
    assert "selected" in selected
    assert methods[selected]["cd"] == methods["wildshape"]["cd"]
    assert "trained with other" not in found.err


def test_models_of_other_settings_are_no_seeds_of_one_method(wildshape, store, trained, tmp_path):
    """A run of another length was pooled with the rest without a word."""
    short = ("train", store, "--out", tmp_path / "short", "--preset", "tiny", "--steps", 1)
    assert wildshape(*short).code == 0
    measure = ("evaluate", store, "--out", tmp_path / "e", "--max-scans", 2, "--as-seeds")
    found = wildshape(*measure, "--baselines", "none", "--model", trained, tmp_path / "short")
    assert found.code == 0
    assert f"short was trained with other settings than {trained.name}" in found.err


def test_train_refuses_and_knows_what_is_finished(wildshape, refused, store, trained):
    again = ("train", store, "--out", trained, "--preset", "tiny", "--steps", 50)
    assert "--resume" in refused(*again)
    found = wildshape(*again, "--resume", "--json")
    assert found.code == 0
    assert json.loads(found.out)["steps"] == 50
    assert "finished already" in wildshape(*again, "--resume").out
    assert "settings" in refused("train", store, "--out", trained, "--preset", "tiny", "--resume")


def test_train_on_folders(wildshape, dataset, tmp_path):
    out = tmp_path / "run"
    shape = ("train", dataset, "--out", out, "--preset", "tiny", "--steps", 2)
    assert wildshape(*shape).code == 0
    assert len(open_store(out / "data.store")) == 6
    assert "finished already" in wildshape(*shape, "--resume").out
    for lost in ("model.safetensors", "state.safetensors", "data.store/index.json"):
        (out / lost).unlink()
    (out / "data.store" / "writing.json").write_text("{}")  # killed while tracks were packed
    assert wildshape(*shape, "--resume").code == 0
    assert len(open_store(out / "data.store")) == 6
    assert wildshape(*shape, "--overwrite").code == 0
