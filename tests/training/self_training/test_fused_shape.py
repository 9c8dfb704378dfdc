# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What scans show together: the object, its other side, and neither strays nor ground."""

from dataclasses import replace

import numpy as np
import pytest
from tests.cars import drive_by, poses_of
from tests.packed import packed
from tests.training.self_training.taught import TAUGHT

from wildshape.geometry.transforms.se3 import SE3
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.fused_shape import (
    FusionConfig,
    _near_others,
    exactly,
    fused_shape,
    sensors_of,
)
from wildshape.training.self_training.headings import PosedTrack


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A store of a car seen from one side, ground beside it, and a bird above; its poses."""
    track, path = drive_by(scans=3, points=600), tmp_path_factory.mktemp("one") / "store"
    poses = poses_of(track)
    low = float(min(T.inverse().apply_numpy(s)[:, 2].min() for T, s in zip(poses, track.scans)))
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 8), (-1.5, -1.7))
    ground = np.stack((x.ravel(), y.ravel(), np.full(x.size, low)), 1).astype(np.float32)
    beside = np.concatenate((ground, np.array([[0.0, 0.0, low + 4.0]], np.float32)))
    scans = [np.concatenate((s, T.apply_numpy(beside))) for T, s in zip(poses, track.scans)]
    store = packed(path, [replace(track, scans=tuple(scans))])
    fitted = SE3(poses.rotation.float(), poses.translation.float())
    return store, PosedTrack(np.arange(3), fitted, 0.0), low


def fused(drive, sensor, *, mirror):
    store, track, _ = drive
    views = ViewSampler(store, np.arange(1), replace(TAUGHT.views, sensor=sensor))
    return fused_shape(views, track, FusionConfig(scan_points=9999), mirror=mirror, voxel_m=0.1)


def test_of_a_lidar_neither_strays_nor_ground_are_fused(drive):
    low = drive[2]
    found = fused(drive, "lidar", mirror=True)
    assert found.shape == (FusionConfig().points, 3)
    assert found[:, 2].max() < low + 3.0
    assert np.abs(found[:, 1]).max() < 1.3
    camera = fused(drive, "camera", mirror=True)
    assert camera[:, 2].max() < low + 3.0
    assert np.abs(camera[:, 1]).max() > 1.4, "a camera's views are cut out of their ground"


def test_the_other_side_is_there_where_objects_are_symmetric(drive):
    sides = []
    for mirror in (True, False):
        found = fused(drive, "lidar", mirror=mirror)
        wall = (np.abs(found[:, 0]) < 1.5) & (np.abs(found[:, 2] + 0.2) < 0.2)
        sides.append(set(np.sign(found[wall, 1]).tolist()))
    assert sides == [{1.0, -1.0}, {-1.0}]


def test_what_is_thin_is_no_stray():
    """A roof of which every third point was seen stays; a point a metre off does not."""
    x, y = np.meshgrid(np.arange(0, 3, 0.1), np.arange(0, 2, 0.1))
    dense = np.stack((x.ravel(), y.ravel(), np.zeros(x.size)), 1)
    roof = dense.reshape(20, 30, 3)[::3, ::3].reshape(-1, 3) + np.array((0.0, 0.0, 2.0))
    points = np.concatenate((dense, roof, [[0.0, 0.0, 3.2]])).astype(np.float32)
    kept = _near_others(points, FusionConfig())
    assert kept[:-1].all()
    assert not kept[-1]


def test_exactly_so_many_points_none_left_out_that_has_a_place():
    points = np.arange(15, dtype=np.float32).reshape(5, 3)
    for count in (5, 12):
        times = np.unique(exactly(points, count), axis=0, return_counts=True)[1]
        assert len(times) == 5
        assert times.sum() == count
        assert times.max() - times.min() <= 1
    assert len(np.unique(exactly(points, 3), axis=0)) == 3


def test_places_of_the_sensor_are_spread_over_the_track_from_end_to_end(drive):
    places = drive[1].T_sensor_can.inverse().translation
    assert np.allclose(sensors_of(drive[1], 2), places[[0, 2]], atol=1e-4)
    assert np.allclose(sensors_of(drive[1], 5), places[[0, 0, 1, 2, 2]], atol=1e-4)
