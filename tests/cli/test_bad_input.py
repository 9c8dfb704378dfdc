# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Bad input of several commands, or of `evaluate`; that of `complete` alone is in commands/."""

import json
import shutil

import numpy as np
import pytest

from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply


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


def test_evaluate_needs_truth(refused, dataset, trained, tmp_path):
    track = shutil.copytree(dataset / "000000", tmp_path / "track")
    (track / "poses.txt").unlink()
    out = ("--out", tmp_path / "e", "--model", trained)
    assert "true poses" in refused("evaluate", track, *out)
    assert "no-such-icp" in refused("evaluate", track, *out, "--baselines", "no-such-icp")


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
    assert "drop --unit" in refused(*command, "--overwrite", "--unit", "mm")
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("command", ["complete", "convert", "evaluate"])
def test_work_on_scans_that_changed_is_not_gone_on_with(
    wildshape, refused, dataset, trained, tmp_path, command
):
    data, out = shutil.copytree(dataset, tmp_path / "data"), tmp_path / "out"
    line = {
        "complete": ("complete", data, "--out", out, "--model", trained),
        "evaluate": ("evaluate", data, "--out", out, "--model", trained, "--baselines", "none"),
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
    marker.write_text(marker.read_text().replace('"running"', '"finished"'))
    assert "with other settings or of other data; pass --overwrite" in refused(*line)


def test_one_scan_that_changed_is_completed_again(wildshape, dataset, trained, tmp_path):
    """An interrupted command was finished with the shape of the scan as it had been."""
    scan, (one, other, *_) = tmp_path / "scan.ply", sorted(dataset.glob("*/scans/*.ply"))
    shapes = []
    for name, file in (("out", one), ("new", other), ("out", other)):
        shutil.copy(file, scan)
        assert wildshape("complete", scan, "--out", tmp_path / name, "--model", trained).code == 0
        marker = tmp_path / name / "wildshape.json"
        marker.write_text(marker.read_text().replace('"finished"', '"running"'))
        shapes.append((tmp_path / name / "scan" / "completed" / "scan.ply").read_bytes())
    assert shapes[0] != shapes[1] == shapes[2]


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


@pytest.mark.parametrize("target", ["nowhere", "out"])  # or to itself
def test_a_link_that_leads_nowhere_is_no_place_to_write(
    refused, dataset, store, trained, tmp_path, target
):
    out, model = tmp_path / "out", ("--model", trained)
    out.symlink_to(target)
    for command in (
        ("complete", dataset, "--out", out, *model),
        ("register", dataset, "--out", out / "below", *model),
        ("evaluate", store, "--out", out, *model),
        ("train", store, "--out", out),
        ("convert", "folder", dataset, out),
        ("simulate", out, "--tracks", 1, "--layout", "folders"),
    ):
        said = refused(*command)
        circle = "Symlink loop" in said or "symbolic links" in said  # before Python 3.13, and since
        assert f"{out}: is a link that leads nowhere; " in said or circle
    file = tmp_path / "out.ply"
    file.symlink_to(target)
    assert "pass --overwrite" in refused("fuse", dataset / "000000", "--out", file, *model)
    assert (out.is_symlink(), file.is_symlink()) == (True, True)
