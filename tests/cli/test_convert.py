# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Conversions: the same store whoever works on it, gone on with after a kill, filtered, refused."""

import json
import os
import shutil
import signal
import sys
import time
from dataclasses import fields

import numpy as np
import pytest
from tests.cli.test_interrupted import running
from tests.datasets.write_kitti_raw import in_velo, write_drive

from wildshape.cli.convert import _OURS, _TRUTH, Settings
from wildshape.cli.sources import _NESTED, SOURCES, open_source
from wildshape.datasets.source import Source
from wildshape.io.store import open_store
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


def test_every_source_can_be_opened(tmp_path):
    for name in SOURCES:
        assert isinstance(open_source(name, tmp_path, {}), Source)


def test_every_option_belongs_to_a_source(tmp_path):
    sources = [open_source(name, tmp_path, {}) for name in SOURCES]
    records = [getattr(s, part, s) for s in sources for part in ("self", *_NESTED)]
    known = {name for record in records for name in vars(record)}
    asked = {field.name for field in fields(Settings)} - {*_OURS, *_TRUTH, "keep_ground"}
    assert asked <= known


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
        (("--range-m", 10, 17), 2, 7),
        (("--categories", "Van"), 0, 0),
        (("--categories", "Car,Van"), 4, 16),
        (("--ground", 1.6), 0, 0),
        (("--ground", 1.6, "--keep-ground"), 4, 16),
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


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--every", 0), "--every 0: expected 1 or more"),
        (("--range-m", 9, 3), "nearer first"),
        (("--workers", 0), "--workers 0"),
        (("--split", "train"), "--split: kitti-raw has no such option"),
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


def test_damaged_parts_leave_nothing(refused, drives, tmp_path):
    for number in range(4):
        scan = scan_file(drives, number)
        scan.write_bytes(scan.read_bytes()[:-3])
    for how in (
        ("packed", "--workers", 1),
        ("packed", "--workers", 2),
        ("folders", "--workers", 1),
    ):
        command = ("convert", "kitti-raw", drives, tmp_path / "out", "--layout", *how)
        assert ".bin" in refused(*command)
        assert not (tmp_path / "out").exists()


def test_an_older_store_stays_until_the_new_one_is_whole(wildshape, refused, drives, tmp_path):
    command = ("convert", "kitti-raw", drives, tmp_path / "out", "--workers", 1)
    assert wildshape(*command).code == 0
    before = open_store(tmp_path / "out").fingerprint
    refused(*command)
    scan = scan_file(drives, 0)
    whole = scan.read_bytes()
    scan.write_bytes(whole[:-3])
    refused(*command, "--overwrite", "--every", 2)
    open_store(tmp_path / "out").verify()
    assert open_store(tmp_path / "out").fingerprint == before
    scan.write_bytes(whole)
    assert wildshape(*command, "--overwrite", "--every", 2).code == 0
    assert open_store(tmp_path / "out").scan_count == 8


def test_two_tracks_of_one_name_are_refused(wildshape, drives, tmp_path):
    shutil.copytree(drives / "2011_09_26", drives / "copy")
    for layout in ("packed", "folders"):
        out = tmp_path / layout
        found = wildshape("convert", "kitti-raw", drives, out, "--layout", layout, "--workers", 1)
        assert found.code == 2
        assert "two tracks are named" in found.err.splitlines()[-1]
