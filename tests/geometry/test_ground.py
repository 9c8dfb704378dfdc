# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ground beside a vehicle is found; of a vehicle alone nothing is taken."""

import numpy as np
from tests.cars import drive_by

from wildshape.geometry.ground import skirt


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
