# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from tests.cars import car_surface, drive_by, poses_of, shape_of

from wildshape.datasets.tracks.truth import (
    TruthBuilder,
    fuse_by_truth,
    misplaced,
    shape_mirrored,
    shape_partial,
    whole_shape,
)
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Track

AROUND = ((-0.02, 0.02), (0.3, 1.5))  # heights of the ground and of what stands on it


def test_scans_of_a_drive_meet_on_the_objects_surface():
    track = drive_by(scans=9)
    fused = fuse_by_truth(track)
    assert len(fused) == sum(map(len, track.scans))
    distance, _ = KDTree(track.shape).query(fused)
    assert np.quantile(distance, 0.99) < 0.2
    assert np.median(distance) < 0.06


def test_mirrored_shape_is_its_own_reflection_and_fills_the_far_side():
    track = drive_by(scans=9)
    partial, mirrored = shape_partial(track), shape_mirrored(track)
    reflected = mirrored * np.array((1, -1, 1), np.float32)
    assert KDTree(mirrored).query(reflected)[0].max() < 0.08
    # The sensor passes on the object's right, so it never sees the wall on its left:
    # 0.7 m high, the nearest it sees is its upper edge, half of the height away in the median.
    surface = car_surface()[0]
    wall = surface[surface[:, 1] > 0.84]
    assert np.median(KDTree(partial).query(wall)[0]) == pytest.approx(0.35, abs=0.05)
    assert np.median(KDTree(mirrored).query(wall)[0]) < 0.06


def test_outliers_are_removed_and_the_cloud_is_thin():
    track = drive_by(scans=5)
    stray = poses_of(track)[0].apply_numpy(np.array([[0, 0, 5], [9, 0, 0]], np.float32))
    track = replace(track, scans=(np.concatenate((track.scans[0], stray)), *track.scans[1:]))
    shape = shape_partial(track)
    assert np.abs(shape).max() < 2.5
    cells = np.floor(fuse_by_truth(track) / 0.04)
    assert len(shape) <= len(np.unique(cells, axis=0))


@pytest.mark.parametrize("size", [0.2, 0.02])
def test_the_truth_of_small_objects_is_about_as_dense_as_that_of_vehicles(size):
    track = drive_by(scans=9)
    poses = poses_of(track)
    small = replace(
        track,
        scans=tuple(scan * np.float32(size) for scan in track.scans),
        T_sensor_object=SE3(poses.rotation, poses.translation * size),
        shape=shape_of(track) * np.float32(size),
        shape_kind="partial",
    )
    for made in (shape_partial, shape_mirrored, whole_shape, TruthBuilder().with_shape):
        few, many = (_count(made(one)) for one in (small, replace(track, shape_kind="partial")))
        assert few > many / 2


def _count(made):
    shape = made.shape if isinstance(made, Track) else made
    assert shape is not None
    return len(shape)


def test_truth_that_is_not_where_the_scans_are_is_told():
    track = drive_by(scans=9)
    bare, inverse = replace(track, shape=None), poses_of(track).inverse()
    for one in (track, bare, replace(track, shape=shape_partial(track))):
        assert misplaced(one) == ""
    told = "off its true shape"
    for shape in (shape_of(track) * np.float32(1000), shape_of(track) + np.float32(2)):
        assert told in misplaced(replace(track, shape=shape))
    assert told in misplaced(replace(track, T_sensor_object=inverse))
    assert "do not bring its scans together" in misplaced(replace(bare, T_sensor_object=inverse))


def test_inverted_poses_of_a_short_way_are_told_without_a_shape():
    track = drive_by(scans=9)
    poses, kept = poses_of(track), slice(3, 6)
    short = replace(track, shape=None, scans=track.scans[kept], T_sensor_object=poses[kept])
    assert misplaced(short) == ""
    inverted = replace(short, T_sensor_object=poses[kept].inverse())
    assert np.ptp(fuse_by_truth(inverted), axis=0).max() < 20
    assert "do not bring its scans together" in misplaced(inverted)


def test_a_shape_turned_by_a_quarter_is_told():
    track = drive_by(scans=9)
    ahead, left, up = shape_of(track).T
    assert "off its true shape" in misplaced(
        replace(track, shape=np.stack((-left, ahead, up), axis=1))
    )


def test_a_label_that_is_not_where_the_scans_are_is_told():
    track = replace(drive_by(scans=9), shape=None)
    told = "beside its labelled box"
    poses = poses_of(track)
    on_floor = SE3(poses.rotation, poses.translation - torch.tensor([0, 0, 0.75]))
    assert misplaced(replace(track, label_size_m=(4.2, 1.7, 1.4))) == ""
    assert told in misplaced(replace(track, label_size_m=(1.7, 4.2, 1.4)))
    assert told in misplaced(replace(track, label_size_m=(4.2, 1.7, 1.4), T_sensor_object=on_floor))


def test_no_poses_no_truth():
    with pytest.raises(BadInputError, match=r"drive: no poses"):
        shape_partial(replace(drive_by(scans=2), T_sensor_object=None))


def test_the_ground_is_taken_off_although_a_point_lies_below_it():
    rng = np.random.default_rng(0)
    ground, body = (rng.uniform((-2, -1, low), (2, 1, high), (600, 3)) for low, high in AROUND)
    cloud = np.concatenate((ground, body, [[0.0, 0.0, -1.0]])).astype(np.float32)
    one = SE3(torch.eye(3)[None], torch.zeros(1, 3))
    shaped = TruthBuilder(outliers="none", strip=0.2).with_shape(
        Track("a", (cloud,), ("0",), T_sensor_object=one)
    )
    assert shaped is not None
    assert shape_of(shaped)[:, 2].min() > 0.15
