# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A published frame of PandaSet, where it is at hand."""

from pathlib import Path

import numpy as np
import pytest

from wildshape.datasets.pandaset.pandas_pickle import read_pickled_table
from wildshape.datasets.pandaset.reader import PandaSet
from wildshape.datasets.pandaset.scene import PANDARGT, read_cuboids, read_drive, read_sweep
from wildshape.datasets.tracks.truth import fuse_by_truth

ROOT = Path(__file__).parents[2].parent / "shared" / "data" / "real" / "pandaset_1frame"
SCENE = ROOT / "001"
pytestmark = pytest.mark.skipif(
    not SCENE.is_dir(), reason="PandaSet's frame is not in ../shared/data: not run"
)


@pytest.fixture(scope="module")
def cuboids():
    return read_cuboids(SCENE / "annotations" / "cuboids" / "00.pkl.gz")


@pytest.fixture(scope="module")
def tracks():
    source = PandaSet(ROOT)
    return list(source.tracks_of(*source.parts()))


def test_the_frame_holds_what_it_is_known_to_hold(cuboids):
    assert len(cuboids.tracks) == 151
    assert (cuboids.sensors == PANDARGT).sum() == 12
    sweep = read_pickled_table(SCENE / "lidar" / "00.pkl.gz")
    assert {name: len(values) for name, values in sweep.items()} == dict.fromkeys("xyzitd", 169171)
    points, times = read_sweep(SCENE / "lidar" / "00.pkl.gz")
    assert points.shape == (106886, 3)
    assert np.ptp(times) == pytest.approx(0.103, abs=0.001)


def test_beams_span_what_the_data_sheet_says():
    """From 15 to -25 degrees; from the pose in the file alone, on the road, none points down."""
    drive = read_drive(SCENE, frames=1)
    cloud, _ = read_sweep(SCENE / "lidar" / "00.pkl.gz")

    def elevations(T_world_sensor):
        local = T_world_sensor.inverse().apply_numpy(cloud)
        away = np.linalg.norm(local, axis=1)
        near = (away > 3) & (away < 60)
        return np.degrees(np.arcsin(local[near, 2] / away[near]))

    found = elevations(drive.sensor_pose(0, drive.stamps[0]))
    # The car drives: a frame alone does not tell how far the sensor moved in 0.1 s.
    assert np.percentile(found, 99.9) == pytest.approx(15, abs=0.2)
    assert np.percentile(found, 0.01) == pytest.approx(-25, abs=2)
    assert (found < -6.5).mean() > 0.1
    assert (elevations(drive.T_world_base[0]) < -6.5).mean() < 1e-3


def test_twenty_five_vehicles_with_enough_points(tracks):
    assert len(tracks) == 25
    assert {track.category for track in tracks} == {"car", "pickup truck"}


def test_cars_fill_their_cuboids_lengthwise(tracks, cuboids):
    """Length and width, front and side, are those of the file's y and x."""
    sizes = dict(zip(cuboids.tracks, cuboids.sizes))
    filled, inside = [], []
    for track in tracks:
        size = sizes[track.name.removeprefix("001_")]
        local = fuse_by_truth(track)
        assert size[0] > 1.5 * size[1]
        inside.append((np.abs(local) <= size / 2 + 0.05).all(axis=1).mean())
        filled.append(np.ptp(local, axis=0) / size)
    # One oncoming car's cuboid is off by over 10 cm: 83 %.
    assert min(inside) > 0.8
    assert np.sort(inside)[1] > 0.95
    assert np.median(filled, axis=0) == pytest.approx((0.96, 0.93, 0.82), abs=0.08)


def test_traffic_goes_the_right_way(cuboids):
    """Moving cars ahead in our lanes show their rear, oncoming ones on the left their front."""
    both = cuboids.T_world_object
    drive = read_drive(SCENE, frames=1)
    T = drive.sensor_pose(0, drive.stamps[0]).inverse() @ both
    x, y = T.translation[:, 0].numpy(), T.translation[:, 1].numpy()
    ahead = T.rotation[:, 0, 0].numpy()
    moving = (cuboids.categories == "Car") & (cuboids.sensors != -1)
    moving &= (x > 10) & (x < 70)
    oncoming = moving & (y > 8) & (np.abs(ahead) > 0.9)
    with_us = moving & (np.abs(y) < 5) & (np.abs(ahead) > 0.9)
    assert oncoming.sum() >= 5
    assert with_us.sum() >= 2
    assert (ahead[oncoming] < 0).all()
    assert (ahead[with_us] > 0).all()
