# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground left around a car in its scan does not make the car larger."""

import numpy as np
import torch
from tests.cars import drive_by, poses_of, shape_of

from wildshape.inference.predictor import load


def _with_ground(scan: np.ndarray, T_sensor_object, low: np.ndarray, high: np.ndarray):
    """The scan, and ground up to 35 cm around the car, as the sensor has them."""
    rng = np.random.default_rng(3)
    places = rng.uniform(low[:2] - 0.35, high[:2] + 0.35, (600, 2))
    outside = ((places < low[:2]) | (places > high[:2])).any(1)
    heights = np.full(int(outside.sum()), low[2])
    ground = np.column_stack((places[outside], heights))
    return np.concatenate((scan, T_sensor_object.apply_numpy(ground))).astype(np.float32)


def test_a_box_is_hardly_wider_with_ground_than_without():
    model = load()
    track = drive_by()
    low, high = shape_of(track).min(0), shape_of(track).max(0)
    wider = []
    for i, scan in enumerate(track.scans):
        pose = poses_of(track)[torch.tensor(i)]
        clean = np.asarray(model.complete(scan).box.size)
        grounded = np.asarray(model.complete(_with_ground(scan, pose, low, high)).box.size)
        wider.append((grounded / clean)[:2])
    assert np.mean(wider) < 1.08  # 35 cm on each side would be 1.15 along and 1.4 across


def test_a_raw_answer_and_a_depth_view_keep_all_points():
    """The graph of an export sees all of them; what a camera sees low beside an object is of it."""
    track = drive_by(scans=1)
    low, high = shape_of(track).min(0), shape_of(track).max(0)
    scan = _with_ground(track.scans[0], poses_of(track)[0], low, high)
    assert len(load().look([scan]).seen[0]) < len(scan)
    for of in (load(raw=True), load("chair")):
        assert len(of.look([scan]).seen[0]) == len(scan)
