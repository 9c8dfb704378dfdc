# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape drive`: what is refused before any work is done, and where each drive goes."""

from dataclasses import replace

import numpy as np
import pytest

from wildshape.cli.commands.drive import Settings, _folders
from wildshape.drives.result import FILES
from wildshape.drives.writing.folder import BOXES
from wildshape.errors import BadInputError
from wildshape.io.output import begin

CALIBRATION = "R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n"


@pytest.fixture
def recording(tmp_path):
    folder = tmp_path / "recording"
    folder.mkdir()
    np.save(folder / "000000.npy", np.zeros((10, 3), np.float32))
    return folder


def test_a_calibration_may_be_that_of_the_detections_alone(recording, tmp_path, refused):
    person = tmp_path / "labels.txt"
    person.write_text("0 1 Pedestrian 0 0 0 0 0 0 0 1.7 0.6 0.6 0 1 9 0\n")
    calibration = tmp_path / "calib.txt"
    calibration.write_text(CALIBRATION)
    given = ("drive", recording, "--out", tmp_path / "out", "--calibration", calibration)
    assert "name that format" in refused(*given)
    none = "no box of a vehicle among 1 Pedestrian"
    assert none in refused(*given, "--detections", person)
    assert none in refused(*given, "--detections", person, "--boxes", "json")
    calibration.write_text("nothing")
    assert "calib.txt" in refused(*given, "--detections", person)
    assert not (tmp_path / "out").exists()


def test_detections_are_those_of_one_drive(recording, tmp_path, refused):
    given = ("drive", recording, tmp_path, "--out", tmp_path / "out", "--detections", "boxes.csv")
    assert "give one drive" in refused(*given)


def test_weights_of_depth_cameras_are_refused(recording, tmp_path, refused):
    """They are named `car`, and would find no vehicle without a word."""
    said = refused("drive", recording, "--out", tmp_path / "out", "--model", "car")
    assert "car: was trained on camera scans, but drives are of lidar scans" in said
    assert not (tmp_path / "out").exists()


def test_detections_in_the_output_are_refused(recording, tmp_path, refused):
    (tmp_path / "out").mkdir()
    labels = tmp_path / "out" / "labels.txt"
    labels.write_text("0 1 Car 0 0 0 0 0 0 0 1.7 1.8 4.6 0 1 9 0\n")
    given = ("drive", recording, "--out", tmp_path / "out", "--overwrite", "--detections", labels)
    assert "holds the input" in refused(*given)
    assert labels.exists()


def test_what_was_found_stays_where_nothing_can_replace_it(recording, tmp_path, refused):
    out = tmp_path / "out"
    begin(out, "drive", {}, FILES).finish()
    (out / BOXES).write_text("earlier")
    before = {path: path.read_bytes() for path in out.iterdir()}
    refused("drive", recording, "--out", out, "--overwrite", "--workers", "1")
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_drives_of_one_name_are_told_apart_by_the_folders_above(tmp_path):
    out, one, two = tmp_path / "out", tmp_path / "monday" / "0000", tmp_path / "tuesday" / "0000"
    settings = Settings(source=(one, two), out=out)
    assert _folders(settings, [one]) == {one: out}
    assert _folders(settings, [one, tmp_path / "0001"])[one] == out / "0000"
    expected = {one: out / "monday-0000", two: out / "tuesday-0000"}
    assert _folders(settings, [one, two]) == expected
    below = [folder.with_name("velodyne") / "0000" for folder in (one, two)]
    assert list(_folders(settings, below).values()) == list(expected.values())


def test_a_drive_given_twice_is_refused(recording, tmp_path, refused):
    other = recording.parent / "." / "recording" / ".." / "recording"
    assert "given twice" in refused("drive", recording, other, "--out", tmp_path / "out")


def test_a_drive_where_the_adaptation_goes_is_refused(tmp_path):
    settings = Settings(source=(tmp_path,), out=tmp_path / "out", adapt=True)
    with pytest.raises(BadInputError, match="where the adaptation goes; rename it"):
        _folders(settings, [tmp_path / "adapted", tmp_path / "monday"])
    assert (
        len(_folders(replace(settings, adapt=False), [tmp_path / "adapted", tmp_path / "b"])) == 2
    )


@pytest.mark.parametrize("marker", ["wildshape.json", "wildshape-removed.json"])
def test_several_drives_do_not_go_beside_what_was_found_in_one(marker, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / marker).write_text("{}")
    settings = Settings(source=(tmp_path,), out=tmp_path / "out")
    with pytest.raises(BadInputError, match="holds an output already; several drives"):
        _folders(settings, [tmp_path / "a", tmp_path / "b"])


def test_several_drives_are_gone_on_with(tmp_path):
    for name in ("a", "adapted"):
        (tmp_path / "out" / name).mkdir(parents=True)
        (tmp_path / "out" / name / "wildshape.json").write_text("{}")
    settings = Settings(source=(tmp_path,), out=tmp_path / "out", adapt=True)
    found = _folders(settings, [tmp_path / "a", tmp_path / "b"])
    assert list(found.values()) == [tmp_path / "out" / "a", tmp_path / "out" / "b"]
