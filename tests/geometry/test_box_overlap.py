# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Shared volume of boxes against hand-made cases, shapes cut in the plane, and drawn points."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wildshape.geometry.box import FittedBox, box_iou, fit_box, shared_volume
from wildshape.geometry.footprint import footprint_iou, footprint_overlap, upright_places
from wildshape.geometry.transforms.rotation import rotation_from_quaternion, rotation_z
from wildshape.geometry.transforms.se3 import SE3


def box(centre=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), rotation=None):
    turn = torch.eye(3, dtype=torch.float64) if rotation is None else rotation.double()
    return FittedBox(torch.tensor(centre).double(), torch.tensor(size).double(), turn)


def yaw(degrees):
    return rotation_z(torch.tensor(math.radians(degrees), dtype=torch.float64))


def rotations(seed):
    """Two, as exact as float64 is."""
    draws = torch.randn(2, 4, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return rotation_from_quaternion(draws)


def monte_carlo(a, b, count=400_000):
    """Shared volume from points drawn in `a`, and its standard error."""
    drawn = np.random.default_rng(0).random((count, 3)) - 0.5
    world = drawn * a.size.numpy() @ a.rotation.numpy().T + a.centre.numpy()
    local = (world - b.centre.numpy()) @ b.rotation.numpy()
    share = float((np.abs(local) <= b.size.numpy() / 2).all(1).mean())
    volume = float(a.size.prod())
    return volume * share, volume * math.sqrt(share * (1 - share) / count)


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (box(), 1.0),
        (box((0.5, 0.0, 0.0)), 1 / 3),
        (box((0.5, 0.5, 0.5)), 1 / 15),
        (box((1.0, 0.0, 0.0)), 0.0),
        (box((1.1, 0.0, 0.0)), 0.0),
        (box((9.0, 0.0, 0.0)), 0.0),
        (box(size=(0.5, 0.5, 0.5)), 1 / 8),
        (box(size=(2.0, 2.0, 2.0)), 1 / 8),
        # Two unit squares 45 degrees apart share a regular octagon of width 1.
        (box(rotation=yaw(45.0)), (a := 2 * (math.sqrt(2) - 1)) / (2 - a)),
        (box(rotation=yaw(90.0)), 1.0),
        (box(rotation=yaw(180.0)), 1.0),
        (box(size=(1.0, 1.0, 0.0)), 0.0),
        (box(size=(0.0, 0.0, 0.0)), 0.0),
    ],
)
def test_hand_made_cases(other, expected):
    assert box_iou(box(), other) == pytest.approx(expected, abs=1e-9)
    assert box_iou(other, box()) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_a_box_of_float32_is_itself(seed):
    points = torch.rand(200, 3, generator=torch.Generator().manual_seed(seed))
    found = fit_box(points * torch.tensor((4.0, 2.0, 1.5)) @ yaw(9.0 * seed).float().mT)
    assert found.rotation.dtype == torch.float32
    assert box_iou(found, found) == pytest.approx(1.0, abs=1e-6)


def test_a_cube_standing_on_its_corner_in_another():
    # Turned about the diagonal by 60 degrees, two unit cubes share two hexagonal pyramids: 3/4.
    axis = torch.ones(3, dtype=torch.float64) / math.sqrt(3)
    cross = torch.linalg.cross(torch.eye(3, dtype=torch.float64), axis.expand(3, 3)).mT
    turn = torch.linalg.matrix_exp(-math.pi / 3 * cross)
    assert shared_volume(box(), box(rotation=turn)) == pytest.approx(0.75, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_as_points_drawn_at_random_say(seed):
    rng = np.random.default_rng(seed)
    turns = rotations(seed)
    a = box(rng.normal(size=3).tolist(), rng.uniform(0.5, 4, 3).tolist(), turns[0])
    b = box((rng.normal(size=3) * 0.8).tolist(), rng.uniform(0.5, 4, 3).tolist(), turns[1])
    expected, error = monte_carlo(a, b)
    assert shared_volume(a, b) == pytest.approx(expected, abs=5 * error + 1e-6)


NUMBERS = st.floats(-3, 3, allow_nan=False, width=32)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(*[st.floats(0.0625, 5, width=32)] * 3),
    st.integers(0, 99),
)
def test_symmetric_and_the_same_wherever_the_two_are(centre, size, seed):
    turn, move = rotations(seed)
    a, b = box(size=(4.0, 1.8, 1.5)), box(centre, size, turn)
    iou = box_iou(a, b)
    assert 0 <= iou <= 1 + 1e-9
    assert box_iou(b, a) == pytest.approx(iou, abs=1e-6)
    far = torch.tensor((30.0, -20.0, 5.0), dtype=torch.float64)
    moved = [FittedBox(move @ x.centre + far, x.size, move @ x.rotation) for x in (a, b)]
    assert box_iou(*moved) == pytest.approx(iou, abs=1e-6)
    assert box_iou(b, b) == pytest.approx(1.0, abs=1e-6)


@given(st.floats(-math.pi, math.pi), st.floats(-2, 2), st.floats(-2, 2))
def test_the_footprint_of_upright_boxes_overlaps_as_the_boxes_do(angle, x, y):
    size, other = (4.0, 1.8, 1.0), (3.0, 1.5, 1.0)
    a, b = box(size=size), box((x, y, 0.0), other, yaw(math.degrees(angle)))
    found = footprint_iou(np.zeros(4), size, np.array((x, y, 0.0, angle)), other)
    assert found == pytest.approx(box_iou(a, b), abs=1e-6)


@given(st.floats(-3.1, 3.1), st.floats(-2, 2), st.floats(-2, 2))
def test_what_a_smaller_box_shares_is_a_part_of_it(angle, x, y):
    size, other = (4.0, 1.8, 1.0), (3.0, 1.5, 1.0)
    pose = SE3(yaw(math.degrees(angle))[None], torch.tensor(((x, y, 0.5),), dtype=torch.float64))
    (place,) = upright_places(pose)
    np.testing.assert_allclose(place, (x, y, 0.5, angle), atol=1e-9)
    shared = shared_volume(box(size=size), box((x, y, 0.0), other, yaw(math.degrees(angle))))
    for found in (
        footprint_overlap(np.zeros(4), size, place, other),
        footprint_overlap(place, other, np.zeros(4), size),
    ):
        assert found == pytest.approx(shared / (3.0 * 1.5), abs=1e-6)
    assert footprint_overlap(place, (0.0, 0.0), place, other) == 0.0


@pytest.mark.parametrize("size", [(0.0, 0.0), (0.0, 1.0), (2.0, 0.0)])
def test_boxes_without_ground_share_none(size):
    place, large, whole = np.zeros(4), np.array((0.1, 0.2, 0.0, 0.3)), (4.0, 1.8)
    assert footprint_iou(place, size, large, whole) == 0.0
    assert footprint_iou(large, whole, place, size) == 0.0
    assert footprint_iou(place, size, place, size) == 0.0
