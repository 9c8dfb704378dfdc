# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
import torch

from wildshape.evaluation.metrics import (
    completion_error,
    distance_floor,
    hull_area,
    registration_error,
)
from wildshape.geometry.transforms.rotation import random_rotation, rotation_z
from wildshape.geometry.transforms.se3 import SE3


def random_pose(count, seed):
    generator = torch.Generator().manual_seed(seed)
    rotation = random_rotation(count, generator).double()
    # Quaternions drawn in float32: make them rotations in float64 too.
    u, _, vt = torch.linalg.svd(rotation)
    return SE3(u @ vt, 20 * torch.randn(count, 3, generator=generator).double())


def test_completion_error_by_hand():
    truth = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    predicted = np.array([[0, 0, 2], [1, 0, 0], [1, 3, 0]], np.float32)
    error = completion_error(predicted, truth)
    assert error.precision == pytest.approx((2 + 0 + 3) / 3)
    # The first true point is 2 from the first predicted one, but only 1 from the second.
    assert error.coverage == pytest.approx((1 + 0) / 2)
    assert error.cd == pytest.approx(5 / 3 + 1 / 2)


def test_completion_error_ignores_rigid_motion_and_order():
    rng = np.random.default_rng(3)
    predicted, truth = rng.normal(size=(2, 200, 3)).astype(np.float32)
    T = random_pose(1, seed=4)[0]
    moved = completion_error(T.apply_numpy(predicted[::-1].copy()), T.apply_numpy(truth))
    assert moved.cd == pytest.approx(completion_error(predicted, truth).cd, rel=1e-4)


def test_whole_prediction_counts():
    truth = np.zeros((4, 3), np.float32)
    near = np.zeros((4, 3), np.float32)
    far = np.concatenate((near, np.full((4, 3), 9, np.float32)))
    assert completion_error(near, truth).cd == 0
    assert completion_error(far, truth).precision == pytest.approx(9 * math.sqrt(3) / 2)


def test_registration_error_by_hand():
    # The object stands 10 m ahead in both scans; the method answers with 90 degrees of yaw about
    # the sensor, so the object's origin lands 10 sqrt(2) m away.
    T_sensor_object = SE3(
        torch.eye(3, dtype=torch.float64)[None],
        torch.tensor([[10.0, 0, 0]], dtype=torch.float64),
    )
    quarter = SE3(
        rotation_z(torch.tensor([math.pi / 2], dtype=torch.float64)),
        torch.zeros(1, 3, dtype=torch.float64),
    )
    error = registration_error(quarter, T_sensor_object, T_sensor_object[0])
    assert error.rotation_deg.item() == pytest.approx(90)
    assert error.rotation_sym_deg.item() == pytest.approx(90)
    assert error.translation_m.item() == pytest.approx(10 * math.sqrt(2))


def test_half_turn_is_forgiven_by_the_symmetric_error_only():
    T_sensor_object = random_pose(5, seed=0)
    flip = SE3(
        rotation_z(torch.tensor(math.pi, dtype=torch.float64)), torch.zeros(3, dtype=torch.float64)
    )
    predicted = T_sensor_object[2] @ flip @ T_sensor_object.inverse()
    error = registration_error(predicted, T_sensor_object, T_sensor_object[2])
    assert torch.allclose(error.rotation_deg, torch.full((5,), 180.0).double(), atol=1e-4)
    assert error.rotation_sym_deg.max() < 1e-4
    assert error.translation_m.max() < 1e-9


def test_no_error_without_error():
    T_sensor_object = random_pose(6, seed=5)
    predicted = T_sensor_object[3] @ T_sensor_object.inverse()
    error = registration_error(predicted, T_sensor_object, T_sensor_object[3])
    assert error.rotation_deg.max() < 1e-5
    assert error.translation_m.max() < 1e-9


def test_floor_is_the_mean_distance_to_random_points():
    # Points spread at random over a unit square torus: mean nearest distance 0.5 / sqrt(density).
    from scipy.spatial import KDTree

    points, queries = np.random.default_rng(0).random((2, 4000, 2))
    measured = KDTree(points, boxsize=1).query(queries)[0].mean()
    assert measured == pytest.approx(distance_floor(1.0, 4000), rel=0.03)


def test_evenly_spread_points_come_under_the_floor():
    # Of a square lattice the mean distance is (sqrt 2 + asinh 1) / 6 = 0.383 of its step.
    from scipy.spatial import KDTree

    side = np.arange(64) / 64
    lattice = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    places = np.random.default_rng(0).random((20_000, 2))
    measured = KDTree(lattice, boxsize=1).query(places)[0].mean()
    assert measured == pytest.approx(0.383 / 0.5 * distance_floor(1.0, 64 * 64), rel=0.02)


def test_hull_area():
    corners = np.array(np.meshgrid([0, 4], [0, 2], [0, 1])).reshape(3, -1).T.astype(np.float32)
    assert hull_area(corners) == pytest.approx(2 * (8 + 4 + 2), rel=1e-6)
    flat = np.random.default_rng(0).random((50, 3)).astype(np.float32) * np.array(
        (1, 1, 0), np.float32
    )
    assert 1 < hull_area(flat) < 2
    assert hull_area(corners[:3]) == 0
