# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.strategies import clouds

from wildshape.geometry.projection.spherical import (
    Spherical,
    from_spherical,
    to_spherical,
    wrap_angle,
)


@given(st.integers(0, 10_000), st.sampled_from([1e-3, 1.0, 100.0]))
def test_round_trip(seed, scale):
    points = clouds(seed, 20, 3, scale=scale)
    back = from_spherical(to_spherical(points))
    torch.testing.assert_close(back, points, atol=1e-12 * scale, rtol=1e-9)


@pytest.mark.parametrize(
    ("point", "azimuth", "pitch", "distance"),
    [
        ((2, 0, 0), 0, 0, 2),
        ((0, 3, 0), math.pi / 2, 0, 3),
        ((-1, 0, 0), math.pi, 0, 1),
        ((0, 0, 5), 0, math.pi / 2, 5),
        ((1, 1, math.sqrt(2)), math.pi / 4, math.pi / 4, 2),
        ((0, -1, -1), -math.pi / 2, -math.pi / 4, math.sqrt(2)),
    ],
)
def test_hand_computed(point, azimuth, pitch, distance):
    polar = to_spherical(torch.tensor([point], dtype=torch.float64))
    assert [float(v) for v in polar] == pytest.approx([azimuth, pitch, distance])


def test_the_origin_has_no_nan():
    polar = to_spherical(torch.zeros(1, 3))
    assert all(bool(v.isfinite().all()) for v in polar)
    assert float(polar.pitch) == 0


def test_polar_to_cartesian_in_a_lidar_frame():
    one = torch.ones(1, dtype=torch.float64)
    left = from_spherical(Spherical(one * math.pi / 2, 0 * one, 4 * one))
    torch.testing.assert_close(left, torch.tensor([[0.0, 4.0, 0.0]], dtype=torch.float64))


@given(st.floats(-20, 20))
def test_wrapping_keeps_the_direction(angle):
    given_angle = torch.tensor(angle, dtype=torch.float64)
    wrapped = wrap_angle(given_angle)
    assert -math.pi <= float(wrapped) <= math.pi
    torch.testing.assert_close(wrapped.sin(), given_angle.sin(), atol=1e-12, rtol=0)
    torch.testing.assert_close(wrapped.cos(), given_angle.cos(), atol=1e-12, rtol=0)
