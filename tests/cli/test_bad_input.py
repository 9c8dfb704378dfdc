# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Each kind of bad input, at the command line."""

import errno
import json
import shutil

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from wildshape.inference.folders import complete_folder
from wildshape.io.poses import read_poses, write_poses
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply


@pytest.fixture
def scan(dataset):
    return read_points(dataset / "000000" / "scans" / "000000.ply")


@pytest.fixture
def track(dataset, tmp_path):
    return shutil.copytree(dataset / "000000", tmp_path / "track")


def bad_scan(kind, scan):
    cases = {
        "empty": (scan[:0], "0 finite points"),
        "fewer than 16": (scan[:15], "15 finite points"),
        "all equal": (np.repeat(scan[:1], 100, 0), "all 100 points are equal"),
        "millimetres": (1000 * scan, "--unit mm"),
        "tiny": (scan / 1000, "at least"),
    }
    return cases[kind]


@pytest.mark.parametrize("kind", ["empty", "fewer than 16", "all equal", "millimetres", "tiny"])
def test_scan(refused, scan, trained, tmp_path, kind):
    points, reason = bad_scan(kind, scan)
    path = tmp_path / "bad.npy"
    np.save(path, points)
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


def test_scans_in_a_map_are_refused_until_their_sensor_is_known(
    wildshape, refused, dataset, trained, tmp_path
):
    """Every command that reads a user's scans: refused without --origin, exactly cured with it."""
    utm = (412_345.5, 5_312_345.25, -421.125)
    for file in sorted((dataset / "000000" / "scans").iterdir()):
        scan = read_points(file).astype(np.float64)
        for name, points in (("here", scan), ("map", scan + utm)):
            (tmp_path / name).mkdir(exist_ok=True)
            np.save(tmp_path / name / f"{file.stem}.npy", points)
    origin = f"--origin={','.join(map(str, utm))}"
    model = ("--model", trained)
    for i, command in enumerate(
        (
            ("complete", "{}", "--out", "{}-c", *model),
            ("register", "{}/000000.npy", "{}/000005.npy", *model, "--json"),
            ("register", "{}", "--out", "{}-r", *model),
            ("fuse", "{}", "--out", "{}-f.ply", *model),
            ("info", "{}", "--json"),
            ("convert", "folder", "{}", "{}-s"),
            ("train", "{}", "--out", "{}-t", "--preset", "tiny", "--steps", "1"),
        )
    ):
        here, there = (
            [str(word).format(tmp_path / name) for word in command] for name in ("here", "map")
        )
        found = wildshape(*there)
        assert (found.code, "--origin X,Y,Z" in found.err + found.out) == (2, True), (i, found)
        expected, cured = wildshape(*here), wildshape(*there, origin)
        assert (expected.code, cured.code) == (0, 0), (i, cured)
        if "--json" in command:
            assert cured.out.replace("map", "here") == expected.out
    for made in ("c/{}/completed/000003.ply", "r/{}/poses.txt", "f.ply"):
        one, other = (tmp_path / f"{n}-{made.format(n)}" for n in ("here", "map"))
        assert one.read_bytes() == other.read_bytes()


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


def test_what_evaluate_cannot_read_is_counted_as_skipped(wildshape, dataset, trained, tmp_path):
    data = shutil.copytree(dataset, tmp_path / "data")
    write_ply(data / "000000" / "scans" / "000001.ply", np.zeros((3, 3), np.float32))
    (data / "000002" / "poses.txt").write_text("1 0 0\n")
    out = tmp_path / "e"
    baselines = ("--baselines", "identity", "--rotate", "yaw", "--seeds", "2")
    found = wildshape("evaluate", data, "--out", out, "--model", trained, *baselines)
    assert found.code == 0
    metrics = json.loads((out / "metrics.json").read_text())
    for row in metrics["methods"].values():
        assert list(row["scans_skipped"].values()) == [2, 2]  # one of each seed
    assert [(one["track"], one["scan"], len(one["methods"])) for one in metrics["skipped"]] == [
        ("000000", "000001.ply", 2),
        ("000002", "all", 2),
    ]
    assert "Left out, identity: 2 x 3 finite points" in (out / "table.md").read_text("utf-8")


def test_points_that_are_not_finite_are_dropped_and_said_once(wildshape, scan, trained, tmp_path):
    scan[:7] = np.nan
    np.save(tmp_path / "nan.npy", scan)
    found = wildshape("complete", tmp_path / "nan.npy", "--out", tmp_path / "c", "--model", trained)
    assert found.code == 0
    assert found.err.count("dropped 7 points") == 1


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


def test_poses(refused, track, trained, tmp_path):
    command = ("complete", track, "--out", tmp_path / "c", "--model", trained)
    lines = (track / "poses.txt").read_text().splitlines()
    (track / "poses.txt").write_text("\n".join(lines[:-1]) + "\n")
    assert str(track / "poses.txt") in refused(*command)
    lines[2] = "2 0 0 1 0 2 0 1 0 0 2 1"
    (track / "poses.txt").write_text("\n".join(lines) + "\n")
    said = refused(*command)
    assert "3" in said
    assert "8" in said  # line and determinant


def test_input_that_is_none(refused, trained, tmp_path):
    out = ("--out", tmp_path / "c", "--model", trained)
    assert "no such" in refused("complete", tmp_path / "nowhere.ply", *out)
    (tmp_path / "empty").mkdir()
    assert "empty" in refused("complete", tmp_path / "empty", *out)
    assert "no such" in refused("evaluate", tmp_path / "nowhere", *out)
    assert "no such" in refused("train", tmp_path / "nowhere", "--out", tmp_path / "run")
    assert "no such" in refused("report", tmp_path / "nowhere")
    (tmp_path / "text.doc").write_text("hello")
    assert "text.doc" in refused("complete", tmp_path / "text.doc", *out)


def test_evaluate_needs_truth(refused, track, trained, tmp_path):
    (track / "poses.txt").unlink()
    out = ("--out", tmp_path / "e", "--model", trained)
    assert "true poses" in refused("evaluate", track, *out)
    assert "no-such-icp" in refused("evaluate", track, *out, "--baselines", "no-such-icp")


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


def test_output_that_exists(wildshape, refused, dataset, trained, tmp_path):
    out = tmp_path / "c"
    command = ("complete", dataset / "000000", "--out", out, "--model", trained)
    assert wildshape(*command).code == 0
    assert "--overwrite" in refused(*command)
    (out / "notes.txt").write_text("mine")
    assert wildshape(*command, "--overwrite").code == 0
    assert (out / "notes.txt").read_text() == "mine"
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("mine")
    other = ("complete", dataset / "000000", "--out", foreign, "--model", trained)
    assert "not written by this command" in refused(*other, "--overwrite")
    assert "is a file" in refused(*command[:3], foreign / "thesis.tex", "--model", trained)
    assert "exists" in refused("simulate", foreign, "--tracks", 1)


@pytest.mark.parametrize("verb", ["complete", "register", "convert", "evaluate"])
def test_an_output_stays_where_nothing_can_replace_it(wildshape, refused, dataset, tmp_path, verb):
    out = tmp_path / "out"
    command = (verb, dataset, "--out", out)
    if verb == "convert":
        command = (verb, "folder", dataset, out, "--layout", "folders")
    assert wildshape(*command).code == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert "--unit mm" in refused(*command, "--overwrite", "--unit", "mm")
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_output_of_other_settings_is_not_mixed_in(refused, dataset, trained, tmp_path):
    out = tmp_path / "c"
    out.mkdir()
    marker = {"command": "complete", "status": "running", "settings": {"input": "other"}}
    (out / "wildshape.json").write_text(json.dumps(marker))
    command = ("complete", dataset, "--out", out, "--model", trained)
    assert "unfinished output" in refused(*command)
    (out / "wildshape.json").write_text(json.dumps(marker | {"status": "finished"}))
    assert "with other settings" in refused(*command)


@pytest.mark.parametrize("command", ["complete", "convert"])
def test_work_on_scans_that_changed_is_not_gone_on_with(
    wildshape, refused, dataset, trained, tmp_path, command
):
    data, out = shutil.copytree(dataset, tmp_path / "data"), tmp_path / "out"
    line = {
        "complete": ("complete", data, "--out", out, "--model", trained),
        "convert": ("convert", "folder", data, out, "--layout", "folders", "--workers", 1),
    }[command]
    assert wildshape(*line).code == 0
    marker = out / "wildshape.json"
    marker.write_text(marker.read_text().replace('"finished"', '"running"'))
    scan = next(data.glob("*/scans/*.ply"))
    cloud = bytearray(scan.read_bytes())
    cloud[cloud.index(b"end_header\n") + 11 :] = bytes(len(cloud) - cloud.index(b"end_header") - 11)
    scan.write_bytes(cloud)  # as large as it was
    assert "of other data (not as it was: files); repeat" in refused(*line)


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


@pytest.mark.parametrize(
    "arguments",
    [
        ("simulate", "{out}", "--tracks", "0"),
        ("simulate", "{out}", "--seed", "-1"),
        ("simulate", "{out}", "--category", "chair"),
        ("simulate", "{out}", "--meshes", "{out}/none"),
        ("convert", "kitti-raw", "{out}/none", "{out}"),
        ("convert", "nuscenes", "{out}/none", "{out}"),
        ("train", "{store}", "--out", "{out}", "--steps", "0"),
        ("train", "{store}", "--out", "{out}", "--seed", f"{1 << 64}"),
        ("train", "{store}", "--out", "{out}", "--preset", "paper-views"),
        ("evaluate", "{store}", "--out", "{out}", "--seeds", "0"),
        ("evaluate", "{store}", "--out", "{out}", "--max-scans", "0"),
    ],
)
def test_settings(refused, store, tmp_path, arguments):
    refused(*(text.format(out=tmp_path / "out", store=store) for text in arguments))


def test_a_refused_command_leaves_nothing_behind(wildshape, refused, dataset, tmp_path):
    bad, out = tmp_path / "bad", tmp_path / "out"
    bad.mkdir()
    (bad / "scan.ply").write_bytes(b"ply")
    for again in (
        ("convert", "folder", "{}", out),
        ("convert", "folder", "{}", out, "--layout", "folders"),
        ("train", "{}", "--out", out, "--preset", "tiny", "--steps", 1),
    ):
        refused(*(str(word).format(bad) for word in again))
        assert not out.exists()
        assert wildshape(*(str(word).format(dataset) for word in again)).code == 0
        shutil.rmtree(out)


@pytest.mark.parametrize(
    "words",
    [
        ("train", "DATASET", "--preset", "tiny", "--start", "nothere"),
        ("train", "DATASET", "--preset", "tiny", "--teacher", "nothere"),
        ("train", "DATASET", "--preset", "tiny", "--teacher", "shipped", "--headings", "nothere"),
        ("train", "STORE", "--preset", "tiny", "--start", "shipped"),  # of other sizes
        ("train", "DATASET", "--preset", "tiny", "--start", "shipped"),  # packed before
        ("train", "DATASET", "--preset", "dpc-small"),  # for a camera's
        ("demo", "--data", "nothere"),
        ("demo", "--seconds", "nan"),
        ("demo", "--drive-scans", "-1"),
    ],
)
def test_refused_for_a_name_or_weights_it_leaves_nothing_either(
    words, wildshape, dataset, store, tmp_path
):
    given = {"DATASET": dataset, "STORE": store, "nothere": tmp_path / "nothere"}
    found = wildshape(*(given.get(word, word) for word in words), "--out", tmp_path / "out")
    assert found.code == 2
    assert not list(tmp_path.iterdir())
    assert str(tmp_path / "out") not in found.err  # of what is gone nothing can be said


def test_the_input_is_never_overwritten(refused, dataset, store, trained, tmp_path):
    data = shutil.copytree(dataset, tmp_path / "data")
    packed = shutil.copytree(store, tmp_path / "packed")
    before = sorted(tmp_path.rglob("*"))
    for command in (
        ("complete", data, "--out", data, "--model", trained),
        ("complete", data / "000000", "--out", data, "--model", trained),
        ("evaluate", data, "--out", data, "--model", trained),
        ("train", data, "--out", data),
        ("convert", "folder", data, data, "--layout", "folders"),
        ("convert", "packed", packed, packed),
    ):
        assert "holds the input" in refused(*command, "--overwrite")
    assert sorted(tmp_path.rglob("*")) == before


def test_folder_that_cannot_be_written(refused, dataset, trained, tmp_path):
    (tmp_path / "file").write_text("mine")
    out = ("--out", tmp_path / "file" / "c", "--model", trained)
    assert "check the path" in refused("complete", dataset, *out)


def test_control_characters_of_a_file_do_not_reach_the_terminal(refused, trained, tmp_path):
    path = tmp_path / "bad.pcd"
    path.write_bytes(b"\x1b[2J\x07 VERSION")
    said = refused("complete", path, "--out", tmp_path / "c", "--model", trained)
    assert "\x1b" not in said


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
