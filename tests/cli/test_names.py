# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Names of files that are no UTF-8, or as long as the system allows, through all commands."""

import json
import os
import shutil
import sys

import pytest
from tests.io.store.stores import content

from wildshape.io.inputs import open_tracks
from wildshape.io.store.store import open_store
from wildshape.records import Track, as_text

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="did not run: only Linux takes any bytes as a name"
)
TRACK, SCAN = os.fsdecode(b"caf\xe9"), os.fsdecode(b"a\xff.ply")
SPELT = ("caf\\xe9", "a\\xff")
LONGEST = "n" * 251


def renamed(dataset, folder, track, scan):
    """A copy of the tracks, the first track and its first scan under other names."""
    data = shutil.copytree(dataset, folder)
    (data / "000000").rename(data / track)
    (data / track / "scans" / "000000.ply").rename(data / track / "scans" / scan)
    return data


@pytest.fixture(scope="module")
def data(dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("names") / os.fsdecode(b"d\xfcta")
    return renamed(dataset, folder, TRACK, SCAN)


def test_names_are_text_and_the_same_everywhere(data):
    source = open_tracks(data)
    assert source.names[-1] == SPELT[0]
    track = source[len(source) - 1]
    assert (track.name, track.scan_names[-1]) == SPELT
    assert as_text("caf\u00e9") == "caf\u00e9"
    assert as_text("\ud800") == "\\ud800"


def test_json_that_holds_half_a_character_is_spelt_out():
    assert Track("a", (), (), category="\ud83d").category == "\\ud83d"


@pytest.mark.parametrize("name", ["wildshape.json", "n" * 252])
def test_a_track_that_cannot_become_a_folder_is_refused_before_any_work(
    refused, wildshape, dataset, trained, tmp_path, name
):
    """The tracks before it were done, and then: not a directory."""
    data = renamed(dataset, tmp_path / "data", "z", "0.ply")
    (data / "wildshape.json").unlink()
    (data / "z").rename(data / name)
    out = tmp_path / "out"
    assert name[:60] in refused("complete", data, "--out", out, "--model", trained)
    assert not out.exists()
    done = wildshape("convert", "folder", data, out, "--layout", "folders")
    assert (done.code, name[:60] in done.err, "become a file" in done.err) == (2, True, True)


@pytest.mark.parametrize("layout", ["packed", "folders"])
def test_converted_and_reported(wildshape, data, trained, tmp_path, layout):
    out = tmp_path / os.fsdecode(b"\xfcut")
    assert wildshape("convert", "folder", data, out, "--layout", layout).code == 0
    assert SPELT[0] in open_tracks(out).names
    if layout == "packed":
        assert list(content(open_store(out)))
    done = tmp_path / os.fsdecode(b"d\xf6ne")
    drawn = (("info", out, "--out", tmp_path / "page.html"),) if layout == "packed" else ()
    for words in (
        ("complete", out, "--out", done, "--model", trained),
        ("report", done),
        ("info", out),
        *drawn,
    ):
        found = wildshape(*words)
        assert found.code == 0, found
        assert "Traceback" not in found.err
    assert (done / SPELT[0] / "completed" / f"{SPELT[1]}.ply").is_file()
    page = (done / "report.html").read_text("utf-8")
    assert SPELT[0].replace("\\", "\\\\") in page or SPELT[0] in page


def test_boxes_beside_a_skipped_scan(wildshape, data, trained, tmp_path):
    """Its raw name could not be encoded when the boxes were written."""
    track = shutil.copytree(data / TRACK, tmp_path / "track")
    (track / "scans" / SCAN).write_bytes(b"ply")
    found = wildshape(
        "complete", track, "--out", tmp_path / "out", "--model", trained, "--boxes", "json"
    )
    assert found.code == 0, found
    said = json.loads((tmp_path / "out" / "track" / "objects.json").read_text("utf-8"))
    assert [one["scan"] for one in said["skipped"]] == [f"{SPELT[1]}.ply"]
    assert (tmp_path / "out" / "boxes" / "boxes.json").is_file()


def test_evaluated_and_reported(wildshape, data, tmp_path):
    out = tmp_path / "evaluation"
    words = ("--baselines", "identity", "--max-scans", "2", "--rotate", "yaw")
    found = wildshape("evaluate", data, "--out", out, *words)
    assert found.code == 0, found
    assert wildshape("report", out).code == 0


def test_the_longest_names(wildshape, dataset, trained, tmp_path):
    data = renamed(dataset, tmp_path / "data", LONGEST, f"{LONGEST}.ply")
    out = tmp_path / "completed"
    found = wildshape("complete", data, "--out", out, "--model", trained)
    assert found.code == 0, found
    assert (out / LONGEST / "completed" / f"{LONGEST}.ply").is_file()
    assert wildshape("report", out).code == 0


def test_a_name_that_is_too_long_is_the_users_own(refused, dataset, trained, tmp_path):
    out = tmp_path / ("n" * 256)
    said = refused("complete", dataset, "--out", out, "--model", trained)
    assert str(out) in said
    assert "too long" in said
    assert ".part" not in said
