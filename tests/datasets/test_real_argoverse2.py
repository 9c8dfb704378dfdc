# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Published sweeps of Argoverse 2, where they are at hand, against what else their files say."""

from pathlib import Path

import numpy as np
import pytest
import torch
from pyarrow import feather
from tests.cars import poses_of

from wildshape.baselines.icp import LocalIcp
from wildshape.datasets.argoverse2.log import (
    LABELS,
    read_boxes,
    read_city_poses,
    read_sensor_pose,
    read_sweep,
    taken_by,
)
from wildshape.datasets.argoverse2.reader import Argoverse2, find_logs
from wildshape.datasets.tracks.labelled_boxes import Crop, rows_in_box
from wildshape.datasets.tracks.truth import fuse_by_truth
from wildshape.errors import BadInputError

ROOT = Path(__file__).parents[2].parent / "shared" / "data" / "real" / "argoverse2"
LOG = ROOT / "sensor" / "val" / "7fab2350-7eaf-3b7e-a39d-6937a4c1bede"
pytestmark = pytest.mark.skipif(
    not LOG.is_dir(), reason="Argoverse 2's sweeps are not in ../shared/data: not run"
)
# Elevations of a VLP-32C's beams by its data sheet, degrees.
BEAMS = np.loadtxt(
    [
        "-25 -15.639 -11.31 -8.843 -7.254 -6.148 -5.333 -4.667 -4 -3.667 -3.333 -3 -2.667 -2.333"
        " -2 -1.667 -1.333 -1 -0.667 -0.333 0 0.333 0.667 1 1.333 1.667 2.333 3.333 4.667 7 10.333"
        " 15"
    ]
)


@pytest.fixture(scope="module")
def tracks():
    source = Argoverse2(LOG)
    return list(source.tracks_of(*source.parts()))


def test_every_box_holds_as_many_points_as_its_label_says():
    counted, labelled = [], []
    for log in find_logs(ROOT):
        boxes, own = read_boxes(log), feather.read_table(log / LABELS)["num_interior_pts"]
        for sweep in (log / "sensors" / "lidar").glob("*.feather"):
            cloud = read_sweep(sweep).points
            for row in np.flatnonzero(boxes.timestamps == int(sweep.stem)).tolist():
                length, width, height = boxes.sizes[row].tolist()
                plain = Crop(margin=0.0, ground=0.0)
                inside = rows_in_box(cloud, boxes.T_ego_object[row], (length, width, height), plain)
                counted.append(len(inside))
                labelled.append(own[row].as_py())
    assert len(counted) == 209
    assert counted == labelled


@pytest.mark.parametrize("lidar", ["up", "down"])
def test_beams_stand_where_the_data_sheet_has_them(lidar):
    """Only about the right origin, with the right axes, and of the right LiDAR."""
    T_sensor_ego = read_sensor_pose(LOG, lidar).inverse()
    sweep = read_sweep(next((LOG / "sensors" / "lidar").glob("*.feather")))
    cloud, lasers = T_sensor_ego.apply_numpy(sweep.points), sweep.lasers
    away = np.linalg.norm(cloud, axis=1)
    elevation = np.degrees(np.arcsin(cloud[:, 2] / away))
    near = taken_by(lidar, lasers) & (away > 3) & (away < 20)
    beams = [np.median(elevation[near & (lasers == laser)]) for laser in np.unique(lasers[near])]
    # down_lidar hangs upside down and leans by 0.2 degrees; the axes are up_lidar's.
    expected, close = (BEAMS, 0.05) if lidar == "up" else (np.sort(-BEAMS), 0.55)
    assert np.sort(beams) == pytest.approx(expected, abs=close)


@pytest.mark.parametrize("lidar", ["up", "down"])
def test_rays_begin_where_the_lidar_was_when_it_took_them(lidar):
    """About these places beams keep their elevation; the vehicle goes 1 m/s alone.

    How the elevation about the place at the sweep's time departs from a beam's own follows how far
    the LiDAR had gone: 0 times if it had not moved, -1 times if it had come from the other side.
    """
    up, down = (read_sensor_pose(LOG, one) for one in ("up", "down"))
    axes = (up if lidar == "up" else down).inverse()
    moved, off = [], []
    for path in (LOG / "sensors" / "lidar").glob("*.feather"):
        sweep = read_sweep(path)
        sweep = sweep.part(taken_by(lidar, sweep.lasers))
        starts = read_city_poses(LOG).ray_starts(int(path.stem), sweep, (up, down))
        still = axes.apply_numpy(sweep.points.astype(np.float64))
        gone = still - axes.apply_numpy(starts.astype(np.float64))
        away = np.linalg.norm(still, axis=1)
        near, azimuth = (away > 3) & (away < 30), np.arctan2(still[:, 1], still[:, 0])
        waves = [f(k * azimuth) for k in (1, 2, 3) for f in (np.sin, np.cos)]  # of its mounting
        waves = np.stack([np.ones(len(azimuth)), *waves], axis=1)
        about = [np.degrees(np.arcsin(v[:, 2] / np.linalg.norm(v, axis=1))) for v in (still, gone)]
        for laser in np.unique(sweep.lasers):
            rows = np.flatnonzero(near & (sweep.lasers == laser))
            rows = rows[np.abs(about[0][rows] - np.median(about[0][rows])) < 0.3]
            both = np.stack((about[0][rows] - about[1][rows], about[0][rows]), axis=1)
            both -= waves[rows] @ np.linalg.lstsq(waves[rows], both, rcond=None)[0]
            moved.append(both[:, 0])
            off.append(both[:, 1])
    x, y = np.concatenate(moved), np.concatenate(off)
    assert 0.8 < (x @ y) / (x @ x) < 1.5


def test_fifteen_vehicles_with_enough_points(tracks):
    assert len(tracks) == 15
    assert all(len(track.scans) == 2 for track in tracks)
    assert {track.category for track in tracks} == {"regular_vehicle", "box_truck"}


def test_accumulated_cars_fill_their_boxes(tracks):
    """The crop reaches 15 cm around a box: with a wrong pose, points would lie there.

    The boxes are generous, mirrors included, so that few points lie on their very sides.
    """
    boxes = read_boxes(LOG)
    sizes = dict(zip(boxes.tracks, boxes.sizes))
    filled = []
    for track in tracks:
        size = sizes[track.name.removeprefix(f"{LOG.name}_")]
        local = fuse_by_truth(track)
        assert (np.abs(local) <= size / 2 + 0.05).all(axis=1).mean() > 0.9
        filled.append(np.ptp(local, axis=0) / size)
    assert np.median(filled, axis=0) == pytest.approx((0.93, 0.90, 0.83), abs=0.08)


def test_boxes_agree_with_icp_on_well_seen_cars(tracks):
    """Within 2 degrees and 10 cm, measured at the car: four of the five of over 500 points."""
    seen = [track for track in tracks if len(track.scans[0]) > 500]
    assert len(seen) == 5
    agree = 0
    for track in seen:
        T_object_sensor = poses_of(track).inverse()
        T_box = poses_of(track)[1] @ T_object_sensor[0]
        T_icp = LocalIcp().align(track.scans[0], track.scans[1], track.sensor)
        middle = torch.as_tensor(track.scans[0].mean(axis=0, keepdims=True), dtype=torch.float64)
        apart = float((T_icp.apply(middle) - T_box.apply(middle)).norm())
        agree += apart < 0.1 and np.degrees(float((T_box.inverse() @ T_icp).angle())) < 2
    assert agree == 4


def test_the_log_without_calibration_is_refused():
    source = Argoverse2(ROOT)
    other = next(part for part in source.parts() if "adcf7d18" in part)
    with pytest.raises(BadInputError, match=r"egovehicle_SE3_sensor\.feather: no such file"):
        list(source.tracks_of(other))
