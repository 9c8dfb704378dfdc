# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans that somebody moved into a map: refused, or read in their sensor's frame."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.cars import poses_of, shape_of
from tests.packed import packed

from wildshape.datasets.tracks.whole_tracks import Folder
from wildshape.errors import BadInputError
from wildshape.io.inputs import open_tracks
from wildshape.io.scans.points import Coordinates, read_points, read_scan
from wildshape.io.tracks import read_track, write_track
from wildshape.records import Track

_UTM = (412_345.67, 5_312_345.89, 421.05)


def _in_map(path: Path, cloud: np.ndarray, unit_m: float = 1.0) -> Path:
    np.save(path, (cloud.astype(np.float64) + np.array([0, 20, 0])) / unit_m + _UTM)
    return path


@pytest.mark.parametrize("read", [read_scan, read_points])
def test_far_points_are_refused_with_the_cure(read, tmp_path: Path, cloud: np.ndarray) -> None:
    with pytest.raises(BadInputError, match=r"a\.npy: lies .* m from the origin.*--origin X,Y,Z"):
        read(_in_map(tmp_path / "a.npy", cloud))


def test_one_kilometre_is_the_limit(tmp_path: Path, cloud: np.ndarray) -> None:
    for away, refused in ((990, False), (1010, True), (50_000, True)):
        np.save(tmp_path / "a.npy", cloud + np.array([0.0, away, 0.0]))
        if refused:
            with pytest.raises(BadInputError, match="--origin"):
                read_scan(tmp_path / "a.npy")
        else:
            assert len(read_scan(tmp_path / "a.npy").points) == len(cloud)


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("mm", 0.001)])
def test_the_origin_is_subtracted_before_anything_is_rounded(
    unit, metres: float, tmp_path: Path, cloud: np.ndarray
) -> None:
    path = _in_map(tmp_path / "a.npy", cloud, metres)
    found = read_scan(path, Coordinates(unit, _UTM)).points
    np.testing.assert_allclose(found, cloud + np.array([0, 20, 0]), atol=3e-6)


def test_a_file_that_lost_its_centimetres_cannot_be_cured(
    tmp_path: Path, cloud: np.ndarray
) -> None:
    np.save(tmp_path / "a.npy", (cloud + np.array(_UTM)).astype(np.float32))
    with pytest.raises(BadInputError, match=r"a\.npy: .* rounded to float32, to .* cm.*float64"):
        read_scan(tmp_path / "a.npy", Coordinates("m", _UTM))


def test_scans_and_poses_of_a_track_are_moved_and_its_shape_is_not(
    track: Track, tmp_path: Path
) -> None:
    away = np.array([100.0, 20.0, -3.0])
    poses = poses_of(track)
    moved = replace(
        track,
        scans=tuple(scan + away.astype(np.float32) for scan in track.scans),
        T_sensor_object=replace(poses, translation=poses.translation + torch.from_numpy(away)),
    )
    write_track(tmp_path / "t", moved)
    found = read_track(tmp_path / "t", Coordinates("m", (100.0, 20.0, -3.0)))
    for scan, expected in zip(found.scans, track.scans):
        np.testing.assert_allclose(scan, expected, atol=2e-5)
    torch.testing.assert_close(poses_of(found).translation, poses.translation)
    np.testing.assert_array_equal(shape_of(found), track.shape)
    (converted,) = Folder(tmp_path / "t", origin=(100.0, 20.0, -3.0)).tracks_of("0-0")
    np.testing.assert_array_equal(converted.scans[0], found.scans[0])


def test_a_packed_store_is_not_read_otherwise(track: Track, tmp_path: Path) -> None:
    packed(tmp_path / "store", [track])
    assert len(open_tracks(tmp_path / "store", Coordinates())) == 1
    for other in (Coordinates("mm"), Coordinates("m", (1.0, 0.0, 0.0))):
        with pytest.raises(BadInputError, match="leave --unit and --origin away"):
            open_tracks(tmp_path / "store", other)
