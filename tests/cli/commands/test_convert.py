# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Conversions: the same store whoever works on it, gone on with after a kill, filtered, refused."""

import json
import os
import shutil
import signal
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.cli.processes import running
from tests.datasets.street import street
from tests.datasets.write_argoverse2 import write_log
from tests.datasets.write_kitti_raw import in_velo, write_drive

from wildshape.cli.commands.convert import Settings, _options
from wildshape.datasets.sources import open_source
from wildshape.io.store.store import open_store
from wildshape.io.tracks import read_track

FRAMES = 4


@pytest.fixture
def drives(tmp_path):
    """Four drives, each with a car that stands 8, 12, 16 or 20 m away."""
    root = tmp_path / "kitti"
    for number in range(4):
        poses = [(8.0 + 4 * number - i, 3.0, -1.7, 0.3) for i in range(FRAMES)]
        on_car = np.random.default_rng(number).uniform((-2, -0.9, 0.25), (2, 0.9, 1.5), (150, 3))
        clouds = {i: in_velo(on_car[: 120 + 10 * i], pose) for i, pose in enumerate(poses)}
        name = f"2011_09_26_drive_{number:04d}_sync"
        write_drive(root / "2011_09_26" / name, [("Car", 0, poses)], clouds)
    return root


def scan_file(drives, number, frame=0):
    drive = drives / "2011_09_26" / f"2011_09_26_drive_{number:04d}_sync"
    return drive / "velodyne_points" / "data" / f"{frame:010d}.bin"


def test_workers_and_order_do_not_show(wildshape, drives, tmp_path):
    prints = []
    for workers in (1, 2):
        out = tmp_path / f"{workers}"
        assert wildshape("convert", "kitti-raw", drives, out, "--workers", workers).code == 0
        store = open_store(out)
        store.verify()
        prints.append(store.fingerprint)
    assert len(set(prints)) == 1
    assert store.names == tuple(f"2011_09_26_drive_{i:04d}_sync_0000" for i in range(4))
    assert len(store.provenance["parts"]) == 4


def blocked(drives, number):
    """Replace a scan by a pipe, which nobody writes to: whoever reads it waits there."""
    scan = scan_file(drives, number)
    whole = scan.read_bytes()
    scan.unlink()
    os.mkfifo(scan)

    def release():
        scan.unlink()
        scan.write_bytes(whole)

    return release


def wait_for_parts(out, count, process):
    until = time.monotonic() + 300
    while len(list(out.glob(".parts/0*/part.json"))) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_conversion_goes_on(wildshape, refused, drives, tmp_path, workers):
    undisturbed, out = tmp_path / "undisturbed", tmp_path / "out"
    command = ("convert", "kitti-raw", drives, "--workers", 1)
    assert wildshape(*command, undisturbed).code == 0
    command = (*command, out)
    release = blocked(drives, 2)
    finished = 2 if workers == 1 else 3
    with running(*command, "--workers", workers) as process:
        wait_for_parts(out, finished, process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    release()
    assert "half-written" in refused("complete", out, "--out", tmp_path / "c")
    assert "other settings" in refused(*command, "--min-points", 50)
    shards = {file.stat().st_ino for file in out.glob(".parts/0*/store/points-*")}
    # The disk lost the end of one of the finished parts: it counts as unfinished.
    damaged = out / ".parts" / "000001" / "store" / "points-00000.safetensors"
    shards.remove(damaged.stat().st_ino)
    damaged.write_bytes(damaged.read_bytes()[:-4])
    found = wildshape(*command)
    assert found.code == 0
    assert "going on" in found.err
    assert shards <= {file.stat().st_ino for file in out.glob("points-*")}
    assert open_store(out).fingerprint == open_store(undisturbed).fingerprint
    open_store(out).verify()
    assert not list(out.glob(".*"))


def test_folders_go_on_too(wildshape, drives, tmp_path):
    out = tmp_path / "out"
    command = ("convert", "kitti-raw", drives, out, "--layout", "folders", "--workers", 1)
    release = blocked(drives, 2)
    with running(*command) as process:
        wait_for_parts(out, 2, process)
        assert not list(out.glob("2*"))  # a track appears whole
        process.send_signal(signal.SIGKILL)
        process.wait()
    release()
    kept = {file.stat().st_ino for file in out.glob(".parts/0*/tracks/*/poses.txt")}
    (out / ".parts" / ".000002.dead" / "tracks" / "000000" / ".scans.part").mkdir(parents=True)
    assert wildshape(*command).code == 0
    assert kept <= {file.stat().st_ino for file in out.glob("*/poses.txt")}
    assert len([read_track(folder) for folder in out.glob("2*")]) == 4
    assert [path.name for path in out.iterdir() if path.name.startswith(".")] == []
    assert json.loads((out / "wildshape.json").read_text())["status"] == "finished"


def test_what_is_left_out_is_told_by_reason_and_part(wildshape, drives, tmp_path):
    command = ("convert", "kitti-raw", drives, tmp_path / "out", "--workers", 1)
    found = wildshape(*command, "--min-points", 131, "--json")
    said = json.loads(found.out)
    reason = "scan: fewer than 131 points on the object"
    assert said["left_out"] == {reason: 8}
    assert [part["left_out"] for part in said["parts"]] == [{reason: 2}] * 4
    assert (said["tracks"], said["scans"], said["points"]) == (4, 8, 4 * (140 + 150))
    assert open_store(tmp_path / "out").provenance["left_out"] == {reason: 8}
    assert reason in found.err


@pytest.mark.parametrize(
    ("options", "tracks", "scans"),
    [
        (("--every", 2), 4, 8),
        (("--min-scans", 5), 0, 0),
        (("--min-mean-points", 136), 0, 0),
        (("--min-mean-points", 135), 4, 16),
        (("--range-m", "10,17"), 2, 7),
        (("--categories", "Van"), 0, 0),
        (("--categories", "Car,Van"), 4, 16),
        (("--ground", 1.6), 0, 0),
        (("--keep-ground",), 4, 16),
    ],
)
def test_filters(wildshape, drives, tmp_path, options, tracks, scans):
    command = ("convert", "kitti-raw", drives, tmp_path / "out", "--workers", 1, "--json")
    found = wildshape(*command, *options)
    if not tracks:
        assert found.code == 2
        assert "no track came out" in found.err
        assert not (tmp_path / "out").exists()
        return
    said = json.loads(found.out)
    assert (said["tracks"], said["scans"]) == (tracks, scans)
    assert ("no track is of the category 'Van'" in found.err) == ("Car,Van" in options)


def test_values_apart_never_swallow_what_follows(wildshape, drives, tmp_path):
    """`--range-m 10 17 ROOT OUT` would read ROOT as a number, or write to another place."""
    found = wildshape("convert", "kitti-raw", "--range-m", 10, 17, drives, tmp_path / "out")
    assert found.code == 2
    assert not (tmp_path / "out").exists()
    before = ("convert", "kitti-raw", "--range-m", "10,17", drives, tmp_path / "out", "--json")
    assert json.loads(wildshape(*before, "--workers", 1).out)["tracks"] == 2


def test_truth(wildshape, drives, tmp_path):
    for kind in ("partial", "mirrored"):
        out = tmp_path / kind
        command = ("convert", "kitti-raw", drives, out, "--workers", 1)
        assert wildshape(*command, "--truth", kind).code == 0
    half, both = open_store(tmp_path / "partial"), open_store(tmp_path / "mirrored")
    for track in range(4):
        partial, mirrored = half.shape_of(track), both.shape_of(track)
        assert partial is not None
        assert mirrored is not None
        assert len(partial) < len(mirrored) <= 2 * len(partial)
        assert np.abs(mirrored[:, 1].mean()) < 0.02
        kinds = [store.track(track).shape_kind for store in (half, both)]
        assert kinds == ["partial", "mirrored"]


def test_an_explicit_zero_is_a_wish(wildshape, drives, tmp_path):
    """0 == False, but it is no option that was left out."""
    box = np.array([[2.1, 0.0, 0.5], [1.0, 0.0, 0.1], [0.0, 0.0, 0.8]])
    write_drive(
        drives / "2011_09_26" / "2011_09_26_drive_0004_sync",
        [("Car", 0, [(9.0, 0.0, -1.7, 0.0)])],
        {0: in_velo(box, (9.0, 0.0, -1.7, 0.0))},
    )
    command = ("convert", "kitti-raw", drives, tmp_path / "out", "--workers", 1, "--json")
    found = wildshape(*command, "--min-points", 0, "--margin", 0, "--ground", 0)
    assert json.loads(found.out)["tracks"] == 5
    store = open_store(tmp_path / "out")
    asked = store.provenance["settings"]
    assert (asked["selection"]["min_points"], asked["crop"]) == (0, {"margin": 0, "ground": 0})
    assert len(store.scan_points(store.scan_count - 1)) == 2  # on the ground, and above it


@pytest.mark.parametrize(("option", "field"), [("edge", "cut"), ("gap", ""), ("max_depth", "cut")])
def test_zeros_reach_the_reader(tmp_path, option, field):
    zero = 0.0 if option == "max_depth" else 0
    settings = replace(Settings("rgbd", tmp_path, tmp_path / "out"), **{option: zero})
    source = open_source("rgbd", tmp_path, _options(settings))
    assert getattr(getattr(source, field) if field else source, option) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--gap", -1), "--gap -1: expected 0 or more"),
        (("--margin", "nan"), "--margin nan: expected a number"),
        (("--categories", ","), "--categories names no category"),
        (("--every", 0), "--every 0: expected 1 or more"),
        (("--ground", 1.6, "--keep-ground"), "--ground has no effect beside --keep-ground"),
        (("--range-m", "9,3"), "nearer first"),
        (("--workers", 0), "--workers 0"),
        (("--split", "train"), "--split: kitti-raw has no such option"),
        (("--ground-strip", 3), "--ground-strip has no effect without --truth"),
        (("--truth", "partial", "--outlier-radius", 2), "has no effect without --outliers radius"),
        (
            ("--truth", "partial", "--outliers", "radius", "--outlier-radius", "nan"),
            "--outlier-radius nan: expected metres above 0",
        ),
    ],
)
def test_options_that_make_no_sense(refused, drives, tmp_path, options, said):
    assert said in refused("convert", "kitti-raw", drives, tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


def test_ray_is_named_where_it_is_missing(refused, drives, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    said = refused("convert", "kitti-raw", drives, tmp_path / "out", "--ray", "local")
    assert "wildshape[ray]" in said
    assert not (tmp_path / "out").exists()


def labels_of(drives, number):
    return scan_file(drives, number).parents[2] / "tracklet_labels.xml"


def test_a_damaged_part_is_left_out_and_told(wildshape, drives, tmp_path):
    labels_of(drives, 1).write_text("<a/>")
    scan_file(drives, 2).write_bytes(b"123")
    scan = f"scan: {scan_file(drives, 2)}: 3 bytes, expected a multiple of 16"
    for workers in (1, 2):
        out = tmp_path / str(workers)
        found = wildshape("convert", "kitti-raw", drives, out, "--workers", workers, "--json")
        said = json.loads(found.out)
        assert (said["tracks"], said["scans"]) == (3, 11)
        assert "1 of 4 parts are damaged" in found.err
        assert "tracklet_labels.xml: holds no tracklets" in found.err
        assert said["left_out"]["part: damaged, left out whole"] == 1
        assert any(reason.startswith(scan) for reason in said["left_out"])
        assert "holds no tracklets" in said["parts"][1]["damage"]
        assert open_store(out).provenance["parts"] == said["parts"]


def test_a_log_without_calibration_is_left_out_and_the_others_are_read(wildshape, tmp_path):
    pytest.importorskip("pyarrow", reason="pyarrow is not installed (extra arrow): not run")
    root = tmp_path / "sensor" / "val"
    scene = street(4, points=20000)
    for name in ("log-a", "log-b", "log-c"):
        write_log(root / name, scene)
    shutil.rmtree(root / "log-b" / "calibration")
    found = wildshape("convert", "argoverse2", tmp_path / "sensor", tmp_path / "out", "--json")
    assert found.code == 0, found.err
    said = json.loads(found.out)
    assert "1 of 3 parts are damaged" in found.err
    assert said["left_out"]["part: damaged, left out whole"] == 1
    (damage,) = [part["damage"] for part in said["parts"] if part.get("damage")]
    assert "log-b" in damage
    tracks = [part["tracks"] for part in said["parts"] if not part.get("damage")]
    assert len(tracks) == 2
    assert tracks[0] == tracks[1] > 0


def test_damaged_parts_leave_nothing(refused, drives, tmp_path):
    for number in range(4):
        for scan in scan_file(drives, number).parent.iterdir():
            scan.write_bytes(scan.read_bytes()[:-3])
    for how in (
        ("packed", "--workers", 1),
        ("packed", "--workers", 2),
        ("folders", "--workers", 1),
    ):
        command = ("convert", "kitti-raw", drives, tmp_path / "out", "--layout", *how)
        said = refused(*command)
        assert "0000000000.bin: " in said
        assert "(and 3 more parts are damaged)" in said
        assert not (tmp_path / "out").exists()


def test_an_older_store_stays_until_the_new_one_is_whole(wildshape, refused, drives, tmp_path):
    command = ("convert", "kitti-raw", drives, tmp_path / "out", "--workers", 1)
    assert wildshape(*command).code == 0
    before = open_store(tmp_path / "out").fingerprint
    refused(*command)
    whole = [labels_of(drives, number).read_bytes() for number in range(4)]
    for number in range(4):
        labels_of(drives, number).write_text("<a/>")
    refused(*command, "--overwrite", "--every", 2)
    open_store(tmp_path / "out").verify()
    assert open_store(tmp_path / "out").fingerprint == before
    for number in range(4):
        labels_of(drives, number).write_bytes(whole[number])
    assert wildshape(*command, "--overwrite", "--every", 2).code == 0
    assert open_store(tmp_path / "out").scan_count == 8


def test_two_tracks_of_one_name_are_refused(wildshape, drives, tmp_path):
    shutil.copytree(drives / "2011_09_26", drives / "copy")
    for layout in ("packed", "folders"):
        out = tmp_path / layout
        found = wildshape("convert", "kitti-raw", drives, out, "--layout", layout, "--workers", 1)
        assert found.code == 2
        assert "two tracks are named" in found.err.splitlines()[-1]


def test_where_nothing_is_left_the_rarer_reasons_are_named_too(wildshape, drives, tmp_path):
    """Of a data set that is there in part, missing files hid that an option left out the rest."""
    part = tmp_path / "part"
    shutil.copytree(drives, part)
    for scans in part.rglob("velodyne_points/data"):
        for file in sorted(scans.iterdir())[1:]:
            file.unlink()
    options = ("--workers", 1, "--largest-m", 0.1)
    found = wildshape("convert", "kitti-raw", part, tmp_path / "out", *options)
    assert found.code == 2
    assert "the frame has no LiDAR file, " in found.err
    assert "over 0.1 m across" in found.err
