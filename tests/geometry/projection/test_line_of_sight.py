# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Of a turn of the sensor nothing is left but the roll about the line of sight."""

import math

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st
from tests.strategies import clouds, rotations

from wildshape.geometry.projection.line_of_sight import face, face_each, roll, roll_angle
from wildshape.geometry.transforms.rotation import rotation_z

AHEAD = torch.tensor((1.0, 0.0, 0.0), dtype=torch.float64)


def scan(seed=0, count=60):
    """An object some 9 m away in any direction that a LiDAR looks in."""
    generator = torch.Generator().manual_seed(seed)
    yaw, pitch = (torch.rand(2, generator=generator).double() - 0.5) * torch.tensor((6.2, 0.8))
    flat = torch.cos(pitch)
    at = torch.stack((flat * torch.cos(yaw), flat * torch.sin(yaw), torch.sin(pitch)))
    return clouds(seed, count, 3) + 9 * at


def seen(points):
    """The scan as a network is given it."""
    frame = face(points)
    return points @ frame.turn.mT - frame.centre


@given(rotations, st.integers(0, 9))
def test_any_turn_of_the_sensor_changes_only_the_roll(R, seed):
    points = scan(seed)
    turned = points @ R.mT
    one, two = face(points), face(turned)
    torch.testing.assert_close(two.centre, one.centre)
    between = two.turn @ R @ one.turn.mT
    torch.testing.assert_close(between @ AHEAD, AHEAD, atol=1e-9, rtol=0)
    angle = torch.atan2(between[2, 1], between[1, 1])
    torch.testing.assert_close(roll(angle[None])[0], between, atol=1e-9, rtol=0)
    torch.testing.assert_close(seen(turned), seen(points) @ between.mT, atol=1e-8, rtol=0)


@given(st.floats(-math.pi, math.pi), st.integers(0, 9))
def test_a_turn_about_the_vertical_changes_nothing(yaw, seed):
    points = scan(seed)
    R = rotation_z(torch.tensor(yaw, dtype=torch.float64))
    torch.testing.assert_close(seen(points @ R.mT), seen(points), atol=1e-8, rtol=0)


@pytest.mark.parametrize("seed", range(4))
def test_the_object_lies_ahead_and_up_is_as_far_up_as_can_be(seed):
    points = scan(seed)
    frame = face(points)
    assert torch.linalg.det(frame.turn) == pytest.approx(1)
    middle = (points / points.norm(dim=1, keepdim=True)).mean(0)
    ahead = frame.turn @ middle
    torch.testing.assert_close(ahead / ahead.norm(), AHEAD)
    assert float(frame.turn[1, 2]) == pytest.approx(0, abs=1e-12)  # left stays level
    assert float(frame.turn[2, 2]) > 0
    ranges = points.norm(dim=1)
    expected = AHEAD * (ranges.min() + ranges.max()) / 2
    torch.testing.assert_close(frame.centre, expected)


def test_many_scans_at_once_and_points_that_do_not_count():
    scans = torch.stack([scan(seed) for seed in range(3)])
    together = face(scans)
    padded = torch.cat((scans, scans[:, :7]), dim=1)
    counted = torch.arange(padded.shape[1]) < scans.shape[1]
    filled = face(padded, counted.expand(3, -1))
    for i in range(3):
        alone = face(scans[i])
        for found in (together, filled):
            torch.testing.assert_close(found.turn[i], alone.turn)
            torch.testing.assert_close(found.centre[i], alone.centre)


@given(st.floats(-3.1, 3.1), st.floats(-math.pi, math.pi), st.floats(-0.3, 0.3))
def test_the_roll_angle_takes_a_rolled_object_upright(tilt, heading, climb):
    """An upright object, seen slightly from above, its frame rolled: rolled back, z is up."""
    assume(abs(abs(tilt) - math.pi) > 1e-3)
    about_y = torch.tensor(
        [
            [math.cos(climb), 0, math.sin(climb)],
            [0, 1, 0],
            [-math.sin(climb), 0, math.cos(climb)],
        ],
        dtype=torch.float64,
    )
    upright = (about_y @ rotation_z(torch.tensor(heading, dtype=torch.float64)))[None]
    angle = roll_angle(roll(torch.tensor([tilt], dtype=torch.float64)) @ upright)
    assert float(angle) == pytest.approx(-tilt, abs=1e-9)
    up = (roll(angle) @ roll(torch.tensor([tilt], dtype=torch.float64)) @ upright)[0, :, 2]
    assert float(up[1]) == pytest.approx(0, abs=1e-9)
    assert float(up[2]) > 0


OPTICAL_AXIS, DOWN = torch.tensor(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), dtype=torch.float64)


def pictured(seed=0):
    """An object two metres before a camera, a little off its optical axis."""
    aside = torch.tensor((0.1 * seed - 0.2, 0.15 - 0.1 * seed, 0.0)).double()
    return 0.2 * clouds(seed, 60, 3) + 2 * OPTICAL_AXIS + aside


def test_a_camera_looks_along_z_and_its_y_points_down():
    points = pictured()
    middle = (points / points.norm(dim=1, keepdim=True)).mean(0)
    centred = points @ facing_rotation_of(middle).mT
    turn = face(centred, sensor_kind="camera").turn
    torch.testing.assert_close(turn[0], OPTICAL_AXIS, atol=1e-9, rtol=0)
    torch.testing.assert_close(turn[2], -DOWN, atol=1e-9, rtol=0)


@pytest.mark.parametrize("seed", range(4))
def test_up_for_a_camera_is_as_far_up_as_can_be(seed):
    frame = face(pictured(seed), sensor_kind="camera")
    assert torch.linalg.det(frame.turn) == pytest.approx(1)
    assert float(frame.turn[1] @ DOWN) == pytest.approx(0, abs=1e-9)  # left stays level
    assert float(frame.turn[2] @ -DOWN) > 0.9


def test_many_views_at_once_face_as_each_does_alone():
    views = torch.stack([pictured(seed) for seed in range(3)])
    together = face(views, sensor_kind="camera")
    for i, view in enumerate(views):
        alone = face(view, sensor_kind="camera")
        torch.testing.assert_close(together.turn[i], alone.turn)
        torch.testing.assert_close(together.centre[i], alone.centre)


def facing_rotation_of(direction):
    """A rotation that turns `direction` to the optical axis."""
    third = direction / direction.norm()
    first = torch.linalg.cross(DOWN, third)
    first = first / first.norm()
    return torch.stack((first, torch.linalg.cross(third, first), third))


@pytest.mark.parametrize("sensor", ["lidar", "camera"])
def test_scans_of_different_sizes_are_faced_as_each_alone(sensor):
    generator = torch.Generator().manual_seed(4)
    ahead = torch.tensor((9.0, 3.0, -1.0))
    scans = [torch.randn(count, 3, generator=generator) + ahead for count in (16, 5, 300)]
    together = face_each(scans, sensor)
    for scan, turn, centre in zip(scans, *together, strict=True):
        alone = face(scan, sensor_kind=sensor)
        assert torch.equal(turn, alone.turn)
        assert torch.equal(centre, alone.centre)


@pytest.mark.parametrize("sensor", ["lidar", "camera"])
def test_points_all_around_the_sensor_are_turned_by_a_rotation(sensor):
    """Their mean direction is none: a pose of determinant 0 was written."""
    half = torch.randn(40, 3, generator=torch.Generator().manual_seed(5))
    for around in (torch.cat((half, -half)), torch.stack((half, -half), 1).flatten(0, 1)):
        for turn in (face(around, sensor_kind=sensor).turn, face_each([around], sensor).turn[0]):
            torch.testing.assert_close(turn @ turn.mT, torch.eye(3), atol=1e-6, rtol=0)
            assert torch.linalg.det(turn) == pytest.approx(1)
