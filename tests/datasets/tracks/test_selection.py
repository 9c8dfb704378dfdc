# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans of whole scenes are no objects."""

import re

import numpy as np
import pytest

from wildshape.datasets.tracks.selection import LARGEST_M, Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.tracks.whole_tracks import Folder
from wildshape.io.scans.writers import write_ply
from wildshape.method.checkpoint import SHIPPED, load_checkpoint


def scene(reach, sides=2 * np.pi):
    rng = np.random.default_rng(0)
    turn, away = rng.uniform(0, sides, 3000), rng.uniform(3, reach, 3000)
    height = rng.uniform(-1.7, 1, 3000)
    return np.stack((away * np.cos(turn), away * np.sin(turn), height), axis=1).astype(np.float32)


def test_the_bound_is_that_of_the_shipped_weights():
    assert pytest.approx(1.5 * load_checkpoint(SHIPPED)[1].extent_m[1], abs=0.1) == LARGEST_M


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (scene(30), "a full scan with points all around the sensor, no object: cut"),
        (scene(30, sides=1.5), "over 20.1 m across, no single object: .* or raise --largest-m"),
    ],
)
def test_scans_of_scenes_are_left_out_and_named(tmp_path, points, said):
    car = scene(3.5) * (0.5, 0.25, 0.3) + (9, 0, 0)
    write_ply(tmp_path / "a" / "scans" / "0.ply", car.astype(np.float32))
    write_ply(tmp_path / "a" / "scans" / "1.ply", points)
    source = Folder(tmp_path)
    (track,) = all_tracks(source)
    assert track.scan_names == ("0",)
    ((reason, count),) = source.rejected.items()
    assert count == 1

    assert re.search(said, reason)
    wide = Folder(tmp_path, Selection(min_points=16, largest_m=90.0))
    assert len(next(iter(all_tracks(wide))).scans) == 2


def test_how_far_away_a_scan_is_a_stray_point_does_not_say():
    near = Selection(min_points=1, range_m=(5.0, 15.0))
    car = np.concatenate(([[30.0, 0.0, 0.0]], scene(3.5) * 0.3 + (9, 0, 0))).astype(np.float32)
    assert near.objection_to_scan(car) == ""
    assert near.objection_to_scan(2 * car) == "scan: not within 5 to 15 m"


@pytest.mark.parametrize(("mean", "kept"), [(70, 1), (71, 0)])
def test_the_scans_of_an_object_have_so_many_points_on_average(tmp_path, mean, kept):
    car = (scene(3.5) * (0.5, 0.25, 0.3) + (9, 0, 0)).astype(np.float32)
    for name, count in (("0", 40), ("1", 100)):
        write_ply(tmp_path / "a" / "scans" / f"{name}.ply", car[:count])
    source = Folder(tmp_path, Selection(min_points=16, min_mean_points=mean))
    assert len(list(all_tracks(source))) == kept


def test_a_folder_of_full_scans_is_refused(tmp_path, capsys):
    from wildshape.cli.main import main

    (tmp_path / "in").mkdir()
    write_ply(tmp_path / "in" / "0.ply", scene(30))
    with pytest.raises(SystemExit, match="2"):
        main(["convert", "folder", str(tmp_path / "in"), str(tmp_path / "out"), "--workers", "1"])
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"wildshape: {tmp_path / 'in'}: no track came out")
    assert "a full scan with points all around the sensor" in said
    assert not (tmp_path / "out").exists()
