# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wildshape.geometry.box import extent, fit_box
from wildshape.geometry.transforms.rotation import rotation_angle, rotation_z


def filled_box(size, yaw, centre, count=600, seed=0):
    """A cloud in a box, its eight corners often enough to outlive the trimming."""
    generator = torch.Generator().manual_seed(seed)
    inside = torch.rand(count, 3, generator=generator, dtype=torch.float64) - 0.5
    corners = torch.cartesian_prod(*[torch.tensor([-0.5, 0.5], dtype=torch.float64)] * 3)
    points = torch.cat((inside, corners.repeat(8, 1))) * torch.tensor(size).double()
    R = rotation_z(torch.tensor(yaw, dtype=torch.float64))
    return points @ R.mT + torch.tensor(centre).double()


@settings(max_examples=20)
@given(st.floats(-math.pi, math.pi), st.sampled_from([(4.2, 1.7, 1.5), (1.7, 4.2, 1.5)]))
def test_finds_the_box_it_was_drawn_from(yaw, size):
    centre = (3.0, -2.0, 0.5)
    points = filled_box(size, yaw, centre)
    box = fit_box(points)
    assert box.centre.tolist() == pytest.approx(centre, abs=0.02)
    # Angles are tried by the degree: half a degree of 4.2 m is 0.04 m.
    assert box.size.tolist() == pytest.approx((4.2, 1.7, 1.5), abs=0.06)
    long_side = yaw + (math.pi / 2 if size[0] < size[1] else 0)
    R = rotation_z(torch.tensor(long_side, dtype=torch.float64))
    angle = math.degrees(float(rotation_angle(box.rotation.mT @ R)))
    assert min(angle, 180 - angle) < 0.6
    local = (points - box.centre) @ box.rotation
    assert bool((local.abs() <= box.size / 2 + 0.04).all())


@settings(max_examples=20)
@given(st.floats(-math.pi, math.pi))
def test_axes_are_a_turn_about_z_and_x_is_longer_and_looks_forward(yaw):
    box = fit_box(filled_box((4.0, 2.0, 1.0), yaw, (0.0, 0.0, 0.0)))
    assert float(torch.linalg.det(box.rotation)) == pytest.approx(1)
    assert float(box.rotation[2, 2]) == pytest.approx(1)
    assert box.size[0] >= box.size[1]
    assert box.rotation[0, 0] > -1e-9


def test_one_stray_point_in_1500_does_not_stretch_it():
    points = filled_box((4.0, 2.0, 1.0), 0.3, (0.0, 0.0, 0.0), count=1500)
    clean = fit_box(points)
    stray = fit_box(torch.cat((points, torch.tensor([[30.0, -20.0, 9.0]]).double())))
    torch.testing.assert_close(stray.size, clean.size, atol=0.05, rtol=0)


def test_order_does_not_matter():
    points = filled_box((4.0, 2.0, 1.0), 0.3, (1.0, 1.0, 1.0))
    shuffled = fit_box(points[torch.randperm(len(points))])
    for a, b in zip(fit_box(points), shuffled):
        assert torch.equal(a, b)


def test_extent_is_the_diagonal():
    assert extent(np.array([[0, 0, 0], [2, 3, 6], [1, 1, 1]], np.float32)) == pytest.approx(7)
