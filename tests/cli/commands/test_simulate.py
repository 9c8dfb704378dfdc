# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape simulate --drive`."""

import json

import pytest
import trimesh

DRIVE = ("--drive", "--scans", "2", "--sensor", "hdl32", "--seed", "5")


def test_a_drive_is_written_once(wildshape, refused, tmp_path):
    out = tmp_path / "drive"
    found = wildshape("simulate", out, *DRIVE, "--json")
    assert found.code == 0, found
    said = json.loads(found.out)
    assert (said["scans"], said["out"]) == (2, str(out))
    assert said["points"] > 50_000
    assert said["vehicles"] > 5
    assert not (out / ".rows").exists()
    assert "--overwrite" in refused("simulate", out, *DRIVE)
    assert wildshape("simulate", out, *DRIVE, "--overwrite").code == 0
    assert "unfinished" not in (out / "wildshape.json").read_text()


def test_the_users_meshes_drive_there(wildshape, tmp_path):
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    trimesh.creation.box((4.2, 1.7, 1.4)).export(meshes / "car.ply")
    found = wildshape("simulate", tmp_path / "drive", *DRIVE, "--meshes", meshes)
    assert found.code == 0, found
    rows = (tmp_path / "drive" / "truth" / "0000.csv").read_text().splitlines()[1:]
    assert len({tuple(row.split(",")[6:9]) for row in rows}) == 1


@pytest.mark.parametrize("kind", [DRIVE, ("--tracks", 4, "--scans", 2, "--layout", "folders")])
def test_other_meshes_are_not_mixed_in(wildshape, refused, tmp_path, kind):
    """A mesh was replaced after an interrupted run: some scans would be of either."""
    meshes, out = tmp_path / "meshes", tmp_path / "out"
    meshes.mkdir()
    trimesh.creation.box((4.2, 1.7, 1.4)).export(meshes / "car.ply")
    line = ("simulate", out, *kind, "--meshes", meshes)
    assert wildshape(*line).code == 0
    marker = out / "wildshape.json"
    marker.write_text(marker.read_text().replace('"finished"', '"running"'))
    assert wildshape(*line).code == 0
    marker.write_text(marker.read_text().replace('"finished"', '"running"'))
    trimesh.creation.box((4.6, 1.9, 1.6)).export(meshes / "car.ply")
    assert "not as it was: mesh_files" in refused(*line)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--drive", "--tracks", "3"), "--tracks means nothing with --drive"),
        (("--drive", "--ground"), "--ground means nothing with --drive"),
        (("--speed", "3"), "--speed needs --drive"),
        (("--point-times",), "--point-times needs --drive"),
        (("--drive", "--sensor", "depth-camera"), "needs a LiDAR"),
        (("--drive", "--scans", "0"), "at least 1"),
        (("--drive", "--speed", "nan"), "0 to 40"),
        (("--drive", "--seed", "-1"), "0 or more"),
    ],
)
def test_what_makes_no_drive_is_refused(refused, tmp_path, more, said):
    out = tmp_path / "drive"
    assert said in refused("simulate", out, *more)
    assert not out.exists()


@pytest.mark.parametrize("form", [(), ("--drive", "--scans", 1)])
@pytest.mark.parametrize("size", [(1.7, 1.4, 4.2), (1.7, 4.2, 1.4)])
def test_meshes_of_other_axes_are_doubted(wildshape, tmp_path, form, size):
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box(size).export(tmp_path / "meshes" / "car.obj")
    asked = form or ("--tracks", 1, "--scans", 2, "--workers", 1)
    found = wildshape("simulate", tmp_path / "out", *asked, "--meshes", tmp_path / "meshes")
    assert found.code == 0, found.err
    assert "car.obj is 1.7 m along x" in found.err


def test_meshes_are_called_what_the_user_says(wildshape, refused, tmp_path):
    """Not cars: nobody said so."""
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    trimesh.creation.box((7.0, 2.5, 3.2)).export(meshes / "lorry.ply")
    asked = ("--tracks", 1, "--scans", 1, "--workers", 1, "--layout", "folders")
    for name, given in (("", ()), ("car", ("--category", "car"))):
        out = tmp_path / f"tracks{name}"
        assert wildshape("simulate", out, *asked, "--meshes", meshes, *given).code == 0
        assert json.loads(next(out.glob("*/track.json")).read_text()).get("category", "") == name
    camera = ("--sensor", "depth-camera", "--occlusion", 0.9)
    assert "occlusion is of LiDARs" in refused("simulate", tmp_path / "c", *camera)


def test_scans_are_not_corrected_twice(refused, tmp_path):
    said = refused("simulate", tmp_path / "s", "--drive", "--compensated", "--point-times")
    assert "corrected twice" in said
