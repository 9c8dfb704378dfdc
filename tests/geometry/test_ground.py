# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground beside a vehicle is found; of a vehicle alone nothing is taken."""

import numpy as np
import torch
from tests.cars import drive_by

from wildshape.geometry.ground import skirt, without_skirt
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3


def test_ground_around_a_vehicle_is_found_and_the_vehicle_kept():
    car = drive_by(scans=2).shape
    assert car is not None
    rng = np.random.default_rng(0)
    low, high = car.min(0), car.max(0)
    places = rng.uniform(low[:2] - 0.4, high[:2] + 0.4, (800, 2))
    beside = ((places < low[:2] - 0.15) | (places > high[:2] + 0.15)).any(1)
    ground = np.column_stack((places, np.full(800, low[2]) + rng.normal(0, 0.02, 800)))
    found = skirt(np.concatenate((car, ground)).astype(np.float32))
    assert found[len(car) :][beside].mean() > 0.95
    assert found[: len(car)].mean() < 0.01


def test_nothing_is_taken_of_a_vehicle_without_ground():
    car = drive_by(scans=2).shape
    assert car is not None
    assert skirt(car).mean() < 0.01


def test_a_flat_thing_has_no_skirt():
    flat = np.random.default_rng(1).uniform((-2, -1, 0), (2, 1, 0.2), (500, 3))
    assert not skirt(flat.astype(np.float32)).any()


def test_a_scan_loses_the_ground_that_its_pose_puts_beside_its_object():
    car = drive_by(scans=2).shape
    assert car is not None
    body = car[~skirt(car)]
    places = np.random.default_rng(2).uniform((-2.0, 1.3), (2.0, 1.6), (300, 2))
    ground = np.column_stack((places, np.full(300, car[:, 2].min()))).astype(np.float32)
    T_sensor_canonical = SE3(
        rotation_z(torch.tensor(0.7, dtype=torch.float64)),
        torch.tensor((8.0, -3.0, -1.2), dtype=torch.float64),
    )
    scan = T_sensor_canonical.apply_numpy(np.concatenate((body, ground)))
    alone = scan[: len(body)]
    np.testing.assert_array_equal(without_skirt(scan, car, T_sensor_canonical, len(body)), alone)
    # With fewer points than are asked for it is kept whole.
    assert without_skirt(scan, car, T_sensor_canonical, len(body) + 1) is scan
