# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers against tracks whose distances, sides and sizes are known by construction."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import drive_by, poses_of
from tests.packed import packed

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.inputs import open_tracks
from wildshape.io.tracks import write_track
from wildshape.records import Intrinsics, Sensor, Track
from wildshape.report.statistics import statistics
from wildshape.report.statistics.statistics import (
    sample_of,
    statistics_of_store,
    statistics_of_tracks,
)


def around(name="around", scans=8, distance=10.0, height=0.0, category="car"):
    """An object seen from all sides: scan k from azimuth k * 360 / scans of its own frame."""
    azimuth = torch.arange(scans, dtype=torch.float64) * 2 * torch.pi / scans
    # Turned by -azimuth + 180 degrees, the object shows that side to a sensor behind it.
    rotation = rotation_z(torch.pi - azimuth)
    flat = (distance**2 - height**2) ** 0.5
    translation = torch.tensor((flat, 0.0, -height), dtype=torch.float64).repeat(scans, 1)
    poses = SE3(rotation, translation)
    points = np.random.default_rng(0).uniform((-2, -1, -0.5), (2, 1, 0.5), (60, 3))
    clouds = tuple(poses[i].apply_numpy(points.astype(np.float32)) for i in range(scans))
    names = tuple(f"{i:06d}" for i in range(scans))
    return Track(name, clouds, names, category=category, T_sensor_object=poses)


def described(store, sample=0):
    found = statistics_of_store(store, sample_of(len(store), sample), lambda _: None)
    return found, {q.name: q for q in found.quantities}


def test_sides_ranges_and_counts_come_from_the_index(tmp_path):
    shaped = replace(around("b", distance=20.0), shape=np.eye(3, dtype=np.float32))
    store = packed(tmp_path / "store", [around("a"), shaped, around("c", scans=4, category="van")])
    found, by = described(store, sample=1)
    assert (found.tracks, found.scans, found.points, found.read) == (3, 20, 1200, 1)
    assert (found.with_poses, found.with_shape) == (3, 1)
    assert found.categories == {"car": 2, "van": 1}
    assert found.sensors == {"lidar": 3}
    assert by["points"].tally.most == 60
    assert (by["scans"].tally.least, by["scans"].tally.most) == (4, 8)
    assert (by["range"].tally.least, by["range"].tally.most) == pytest.approx((10.0, 20.0))
    assert by["range"].tally.count == 20
    assert by["azimuth"].basis.startswith("object's frame")
    assert by["turn"].tally.count == 3
    assert by["turn"].tally.least == pytest.approx(180.0)


def test_azimuth_is_the_side_that_is_seen(tmp_path):
    """From the left (+90 degrees of the object's own frame), 30 degrees above."""
    left = around(scans=4, distance=10.0, height=5.0).part([1])
    _, by = described(packed(tmp_path / "store", [left]))
    assert by["azimuth"].tally.mean == pytest.approx(90.0)
    assert by["elevation"].tally.mean == pytest.approx(30.0)


def test_the_viewpoint_changes_from_the_middle_scan_s(tmp_path):
    _, by = described(packed(tmp_path / "store", [around(scans=8).part([0, 1, 2])]))
    assert by["turn"].tally.most == pytest.approx(45.0)


def test_a_scan_alone_is_seen_from_one_side(tmp_path):
    """By its rounding the picture drew a median change of 8.54e-07 degrees."""
    for number in range(8):
        alone = around(distance=12.0, height=2.0).part([number])
        _, by = described(packed(tmp_path / f"{number}", [alone]))
        assert by["turn"].tally.most == 0


@pytest.mark.parametrize("block", [1, 4096])
def test_posed_and_unposed_tracks_between_each_other(tmp_path, monkeypatch, block):
    monkeypatch.setattr(statistics, "_BLOCK", block)
    bare = replace(around("bare", distance=90.0), T_sensor_object=None)
    found, by = described(
        packed(tmp_path / "store", [around("a"), bare, around("z", distance=30.0)])
    )
    assert found.with_poses == 2
    assert by["range"].tally.count == 16
    assert by["range"].tally.most == pytest.approx(30.0)


def test_without_truth_the_sensors_frame_is_said_and_used(tmp_path):
    bare = replace(around(), T_sensor_object=None)
    _, by = described(packed(tmp_path / "store", [bare]))
    assert by["azimuth"].basis.startswith("sensor's frame")
    assert by["azimuth"].tally.mean == pytest.approx(0.0, abs=3.0)
    assert by["range"].tally.mean == pytest.approx(10.0, abs=0.3)
    assert "turn" not in by
    assert by["length"].tally.mean == pytest.approx(4.0, abs=0.3)
    assert by["width"].tally.mean == pytest.approx(2.0, abs=0.3)


def test_a_sample_without_truth_is_said_once(tmp_path):
    bare = [replace(around(name), T_sensor_object=None) for name in "abc"]
    _, by = described(packed(tmp_path / "store", bare), sample=1)
    assert by["range"].basis == "sensor's frame, middle of each scan; a sample of 1 of 3 tracks"


def test_without_truth_the_longest_scan_is_measured(tmp_path):
    whole = around(scans=1).scans[0]
    half = whole[whole[:, 0] < whole[:, 0].mean()]
    for scans in ((half, whole), (whole, half)):
        found = statistics_of_store(
            packed(tmp_path / str(len(scans[0])), [Track("t", scans, ("0", "1"))]), [0], print
        )
        by = {q.name: q.tally for q in found.quantities}
        assert by["length"].mean == pytest.approx(4.0, abs=0.3)


def test_a_cameras_axes_are_turned_to_forward_left_up(tmp_path):
    ahead = np.random.default_rng(0).normal((1.0, 2.0, 10.0), 0.05, (50, 3)).astype(np.float32)
    camera = Sensor("camera", intrinsics=Intrinsics(240.0, 240.0, 64.0, 64.0, 128, 128))
    found, by = described(packed(tmp_path / "store", [Track("t", (ahead,), ("0",), sensor=camera)]))
    assert by["azimuth"].tally.mean == pytest.approx(-5.7, abs=0.5)  # to the right
    assert by["elevation"].tally.mean == pytest.approx(-11.2, abs=0.5)  # and below
    assert "upright in its sensor's frame" in by["length"].basis  # cameras may be tilted
    assert found.sensors == {"camera, 128 x 128 px, f 240": 1}


@pytest.mark.parametrize("truth", ["shape", "fused"])
def test_lengths_by_the_best_that_is_known(tmp_path, truth):
    shape = np.asarray([[-3, -1, 0], [3, 1, 2]], np.float32) if truth == "shape" else None
    _, by = described(packed(tmp_path / "store", [replace(around(), shape=shape)]))
    length, basis = (6.0, "truth shapes") if truth == "shape" else (4.0, "scans joined")
    assert by["length"].tally.mean == pytest.approx(length, abs=0.2)
    assert by["length"].basis.startswith(basis)


@pytest.mark.parametrize("kind", ["partial", "mirrored"])
def test_what_scans_were_put_together_to_is_no_true_shape(tmp_path, kind):
    shape = np.asarray([[-3, -1, 0], [3, 1, 2]], np.float32)
    _, by = described(packed(tmp_path / "store", [replace(around(), shape=shape, shape_kind=kind)]))
    assert by["length"].tally.mean == pytest.approx(6.0)
    assert by["length"].basis.startswith("scans joined")


def test_where_only_some_have_their_truth_that_is_said(tmp_path):
    bare = [replace(around(name), T_sensor_object=None) for name in "bcd"]
    shaped = replace(around("a"), shape=np.eye(3, dtype=np.float32))
    found, by = described(packed(tmp_path / "store", [shaped, *bare]))
    assert (found.with_poses, found.with_shape) == (1, 1)
    assert by["range"].basis == "object's frame, by truth; all tracks, 8 of 32 scans"
    assert by["length"].basis == "truth shapes; all tracks, 1 of 4 of these"


def test_folders_say_the_same_as_the_store(tmp_path):
    tracks = [drive_by(name, scans=3, points=50, seed=i) for i, name in enumerate("abc")]
    for track in tracks:
        write_track(tmp_path / "folders" / track.name, track)
    (tmp_path / "folders" / "b" / "scans" / "000001.ply").write_bytes(b"ply\nbroken")
    (tmp_path / "folders" / "d" / "scans").mkdir(parents=True)
    (tmp_path / "folders" / "d" / "scans" / "0.npy").write_bytes(b"")
    source = open_tracks(tmp_path / "folders")
    read = statistics_of_tracks(source, sample_of(len(source), 0), lambda _: None)
    assert (read.tracks, read.read, read.scans) == (4, 3, 8)
    shaped = sum(track.shape is not None for track in tracks)
    assert (read.with_poses, read.with_shape) == (3, shaped)
    assert set(read.unusable) == {"b/000001.ply", "d", "d/0.npy"}
    _, by = described(packed(tmp_path / "store", [tracks[0], tracks[2]]))
    few = statistics_of_tracks(source, [0, 2], lambda _: None)
    assert few.scans is None  # not all were read
    for quantity in few.quantities:
        other = by[quantity.name].tally
        assert quantity.tally.count == other.count, quantity.name
        assert quantity.tally.mean == pytest.approx(other.mean, rel=1e-4, abs=1e-4)


def test_samples_are_repeatable_and_never_too_large():
    assert sample_of(1000, 10) == sample_of(1000, 10)
    assert len(set(sample_of(1000, 10))) == 10
    assert sample_of(5, 10) == sample_of(5, 0) == [0, 1, 2, 3, 4]


def test_poses_that_are_far_away_are_refused(tmp_path):
    track = around()
    poses = SE3(poses_of(track).rotation, poses_of(track).translation + 1e200)
    with pytest.raises(BadInputError, match="store: a pose is not finite or far away"):
        described(packed(tmp_path / "store", [replace(track, T_sensor_object=poses)]))
