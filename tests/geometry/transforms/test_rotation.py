# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.strategies import axes, clouds, rotation_about, rotations

from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    random_rotation,
    random_yaw,
    rotation_angle,
    rotation_from_6d,
    rotation_from_quaternion,
    rotation_from_vector,
    rotation_to_6d,
    rotation_z,
    rotations_about,
)

EYE = torch.eye(3, dtype=torch.float64)
NEAR_ZERO = [0.0, 1e-12, 1e-9, 1e-6, 1e-3]


def assert_rotation(R, atol=1e-12):
    torch.testing.assert_close(R @ R.mT, EYE.expand_as(R), atol=atol, rtol=0)
    torch.testing.assert_close(
        torch.linalg.det(R), torch.ones_like(R[..., 0, 0]), atol=atol, rtol=0
    )


def test_6d_gives_rotations_whatever_the_vectors():
    vectors = clouds(0, 200, 6, scale=3.0)
    assert_rotation(rotation_from_6d(vectors))


def test_6d_forgets_length_and_the_part_along_the_first_vector():
    vectors = clouds(1, 50, 6)
    first, second = vectors[:, :3], vectors[:, 3:]
    changed = torch.cat((5 * first, 0.2 * second - 3 * first), dim=1)
    torch.testing.assert_close(rotation_from_6d(changed), rotation_from_6d(vectors))


@given(rotations)
def test_6d_round_trip(R):
    torch.testing.assert_close(rotation_from_6d(rotation_to_6d(R)), R, atol=1e-12, rtol=0)


def test_6d_gradient():
    vectors = clouds(2, 4, 6).requires_grad_()
    assert torch.autograd.gradcheck(rotation_from_6d, (vectors,))


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-4])
@pytest.mark.parametrize("length", [0.0, 1e-6, 1.0])
def test_6d_gradient_is_finite_at_and_near_degenerate_vectors(gap, length):
    first = length * torch.tensor([0.6, 0.0, 0.8])
    second = first + gap * torch.tensor([0.0, 1.0, 0.0])
    vectors = torch.cat((first, second)).requires_grad_()
    rotation_from_6d(vectors).square().sum().backward()
    assert vectors.grad is not None
    assert vectors.grad.isfinite().all()


@given(rotations)
def test_quaternion_round_trip(R):
    q = quaternion_from_rotation(R)
    assert q[0] >= 0
    assert float(q.norm()) == pytest.approx(1, abs=1e-12)
    torch.testing.assert_close(rotation_from_quaternion(q), R, atol=1e-12, rtol=0)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 0), (1, 2, -3)])
@pytest.mark.parametrize("short", NEAR_ZERO)
def test_quaternion_round_trip_near_the_half_turn(axis, short):
    R = rotation_about(tuple(map(float, axis)), math.pi - short)
    back = rotation_from_quaternion(quaternion_from_rotation(R))
    torch.testing.assert_close(back, R, atol=1e-12, rtol=0)


def test_quaternion_order_is_wxyz_and_scale_does_not_matter():
    quarter = torch.tensor([2.0, 0.0, 0.0, 2.0], dtype=torch.float64)
    expected = torch.tensor([[0, -1, 0], [1, 0, 0], [0, 0, 1]], dtype=torch.float64)
    torch.testing.assert_close(rotation_from_quaternion(quarter), expected)


@given(axes, st.sampled_from([*NEAR_ZERO, 0.5, 2.0]))
def test_angle_keeps_its_digits_near_zero_and_near_the_half_turn(axis, angle):
    found = float(rotation_angle(rotation_about(axis, angle)))
    assert found == pytest.approx(angle, rel=1e-6, abs=1e-15)
    found = float(rotation_angle(rotation_about(axis, math.pi - angle)))
    assert found == pytest.approx(math.pi - angle, abs=1e-9)


def test_angle_of_350_degrees_is_10():
    R = rotation_about((0.0, 0.0, 1.0), math.radians(350))
    assert math.degrees(float(rotation_angle(R))) == pytest.approx(10)


@given(rotations, rotations)
def test_angle_is_the_paper_formula_with_the_absolute_value(R, S):
    """`2 acos |<q, q'>|` (METHOD 8); without the bars half of all pairs come out too large."""
    inner = float(quaternion_from_rotation(R) @ quaternion_from_rotation(S))
    expected = 2 * math.acos(min(1.0, abs(inner)))
    assert float(rotation_angle(R.mT @ S)) == pytest.approx(expected, abs=1e-6)


def test_the_absolute_value_matters():
    R, S = rotation_about((0.0, 0.0, 1.0), 3.0), rotation_about((0.0, 0.0, -1.0), 3.0)
    assert float(quaternion_from_rotation(R) @ quaternion_from_rotation(S)) < 0
    assert float(rotation_angle(R.mT @ S)) == pytest.approx(2 * math.pi - 6)


@given(rotations, rotations)
def test_angle_is_a_distance(R, S):
    assert float(rotation_angle(R)) == pytest.approx(float(rotation_angle(R.mT)), abs=1e-9)
    summed = float(rotation_angle(R) + rotation_angle(S))
    assert float(rotation_angle(R @ S)) <= summed + 1e-7


def test_rotation_z_turns_x_to_y():
    x = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
    R = rotation_z(torch.tensor(math.pi / 2, dtype=torch.float64))
    torch.testing.assert_close(R @ x, torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64))


def test_random_rotations_are_uniform_and_repeatable():
    draws = random_rotation(4000, torch.Generator().manual_seed(3)).double()
    assert_rotation(draws, atol=1e-5)
    # Under the uniform distribution every entry has mean 0 and variance 1/3.
    torch.testing.assert_close(draws.mean(0), torch.zeros_like(EYE), atol=0.04, rtol=0)
    torch.testing.assert_close(
        draws.square().mean(0), torch.full_like(EYE, 1 / 3), atol=0.03, rtol=0
    )
    assert torch.equal(draws, random_rotation(4000, torch.Generator().manual_seed(3)).double())


def test_random_yaw_keeps_z_and_covers_the_circle():
    draws = random_yaw(4000, torch.Generator().manual_seed(4))
    assert torch.equal(draws[:, 2], torch.tensor([0.0, 0.0, 1.0]).expand(4000, 3))
    heading = torch.atan2(draws[:, 1, 0], draws[:, 0, 0])
    counts = torch.histc(heading, 8, -math.pi, math.pi)
    assert counts.min() > 420
    assert counts.max() < 580


def test_turns_about_an_axis_are_those_about_its_vector():
    angle = torch.tensor((-2.0, 0.0, 0.3), dtype=torch.float64)
    for axis in range(3):
        vector = angle[:, None] * torch.eye(3, dtype=torch.float64)[axis]
        found = torch.from_numpy(rotations_about(axis, angle.numpy()))
        torch.testing.assert_close(found, rotation_from_vector(vector))
