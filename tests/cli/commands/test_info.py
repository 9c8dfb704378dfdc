# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import re
import shutil

import numpy as np
import pytest
from PIL import Image

from wildshape.io.store.layout import INDEX_JSON
from wildshape.io.store.store import StoreWriter
from wildshape.records import Track


def test_a_store_is_described(wildshape, store):
    found = wildshape("info", store)
    assert found.code == 0
    assert "6 tracks; 36 scans" in found.out
    for word in (
        "points per scan",
        "object's frame, by truth",
        "truth shapes",
        "made by",
    ):
        assert word in found.out
    assert re.search("[▁▂▃▄▅▆▇█]{3}", found.out)


def test_numbers_for_machines(wildshape, store, dataset):
    packed, folders = (json.loads(wildshape("info", i, "--json").out) for i in (store, dataset))
    assert packed["scans"] == folders["scans"] == 36
    for name, quantity in packed["quantities"].items():
        same = folders["quantities"][name]
        assert same["count"] == quantity["count"]
        assert same["mean"] == pytest.approx(quantity["mean"], rel=1e-4, abs=1e-3)
        assert sum(quantity["histogram"]["shares"]) == pytest.approx(1.0)


def test_page_picture_and_numbers_are_written_and_never_over_others(
    wildshape, refused, store, tmp_path
):
    out = tmp_path / "info"
    out.mkdir()
    (out / "info.html").write_text("another's")
    assert "--overwrite" in refused("info", store, "--out", out)
    assert (out / "info.html").read_text() == "another's"
    assert wildshape("info", store, "--out", out, "--overwrite").code == 0
    with Image.open(out / "info.png") as picture:
        pixels = np.asarray(picture.convert("L"))
    assert (pixels < 128).mean() > 0.02  # something is drawn
    page = (out / "info.html").read_text(encoding="utf-8")
    assert page.count("<img") >= 10
    assert json.loads((out / "info.json").read_text())["tracks"] == 6


def test_bad_inputs_are_one_sentence(refused, store, tmp_path):
    assert "no such file" in refused("info", tmp_path / "nothing")
    assert ".html" in refused("info", store, "--out", tmp_path / "a.gif")
    (tmp_path / "t" / "scans").mkdir(parents=True)
    (tmp_path / "t" / "scans" / "0.npy").write_bytes(b"")
    assert "0.npy" in refused("info", tmp_path / "t")


def test_what_was_left_out_and_names_with_markup_are_shown_as_they_are(wildshape, tmp_path):
    scan = np.random.default_rng(0).normal(5.0, 1.0, (40, 3)).astype(np.float32)
    made = {"command": "convert [bold]x[/bold]", "left_out": {"scan: [red]few": 7, "object: no": 9}}
    made |= {"settings": {"selection": {"motion": "parked"}}, "parts": [{"part": "part 17"}]}
    with StoreWriter(tmp_path / "s", made) as writer:
        writer.add(Track("[link=x]", (scan,), ("0",), category="[/]$x^\x1b[31m"))
    found = wildshape("info", tmp_path / "s", "--out", tmp_path / "s.html")
    assert found.code == 0
    assert "object: no 9; scan: [red]few 7" in found.out
    assert "convert [bold]x[/bold]" in found.out
    assert "parked objects only" in found.out
    assert "part 17" not in (tmp_path / "s.html").read_text(encoding="utf-8")
    assert "\x1b[31m" not in found.out
    assert "scan: [red]few" in (tmp_path / "s.html").read_text(encoding="utf-8")


def test_a_damaged_record_does_not_hide_the_tracks(wildshape, dataset, tmp_path):
    assert (dataset / "wildshape.json").is_file()
    folder = tmp_path / "t"
    (folder / "scans").mkdir(parents=True)
    np.save(folder / "scans" / "0.npy", np.random.default_rng(0).normal(size=(40, 3)))
    for name in ("wildshape.json", INDEX_JSON):
        (folder / name).write_text("[1, 2")
    (folder / INDEX_JSON).unlink()
    assert wildshape("info", folder).code == 0


def test_the_first_file_that_cannot_be_read_is_named(wildshape, dataset, tmp_path):
    data = tmp_path / "data"
    shutil.copytree(dataset, data)
    scan = next((data / "000001" / "scans").iterdir())
    scan.write_bytes(scan.read_bytes()[:300])
    found = wildshape("info", data)
    assert found.code == 0
    assert f"first: {scan}: the header promises" in found.err
    assert "copy or write it again" in found.err


def test_tracks_that_cannot_be_read_make_no_sample(wildshape, dataset, tmp_path):
    data = shutil.copytree(dataset, tmp_path / "data")
    (data / "000001" / "poses.txt").write_text("no numbers\n")
    said = wildshape("info", data).out
    assert "The points of 5 of 6 tracks can be read." in said
    assert "scans per track: 5 of 6 tracks" in said
    assert "sample" not in said


def test_a_sample_below_nothing_is_refused(refused, store):
    assert "--sample -3: expected 0 or more" in refused("info", store, "--sample", -3)
