# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Overlaps of upright boxes by hand, and boxes around points."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from wildshape.evaluation.drives.overlap import Overlaps, UprightBox, overlaps
from wildshape.evaluation.drives.rectangles import l_shape, smallest_rectangle
from wildshape.geometry.box import FittedBox, box_iou
from wildshape.geometry.transforms.rotation import rotation_z

CAR = UprightBox(10.0, 5.0, 0.0, 4.0, 2.0, 1.5, 0.0)


@pytest.mark.parametrize(
    ("other", "bev", "space", "on"),
    [
        (CAR, 1, 1, 1),
        (CAR._replace(x=11), 6 / 10, 6 / 10, 6 / 8),
        (CAR._replace(yaw=math.pi), 1, 1, 1),
        (CAR._replace(yaw=math.pi / 2), 4 / 12, 4 / 12, 4 / 8),
        (CAR._replace(z=0.75), 1, 1 / 3, 1),
        (CAR._replace(z=2.0), 1, 0, 1),
        (CAR._replace(length=8.0), 8 / 16, 8 / 16, 1),
        (CAR._replace(x=14.5), 0, 0, 0),
    ],
)
def test_by_hand(other: UprightBox, bev: float, space: float, on: float) -> None:
    found = overlaps([CAR], [other])
    assert found.bev[0, 0] == pytest.approx(bev)
    assert found.space[0, 0] == pytest.approx(space)
    assert found.on[0, 0] == pytest.approx(on)


_SIZE, _PLACE = st.floats(0.3, 8.0), st.floats(-4.0, 4.0)
_BOX = st.builds(UprightBox, _PLACE, _PLACE, _PLACE, _SIZE, _SIZE, _SIZE, st.floats(-7.0, 7.0))


def _fitted(box: UprightBox) -> FittedBox:
    parts = torch.tensor(box[:3]).double(), torch.tensor(box[3:6]).double()
    return FittedBox(*parts, rotation_z(torch.tensor(box.yaw).double()))


@given(_BOX, _BOX)
def test_in_space_as_boxes_of_any_rotation(a: UprightBox, b: UprightBox) -> None:
    assert overlaps([a], [b]).space[0, 0] == pytest.approx(
        box_iou(_fitted(a), _fitted(b)), abs=1e-5
    )


def _tables(found: Overlaps) -> tuple[np.ndarray, ...]:
    return found.bev, found.space, found.on


@given(st.lists(_BOX, max_size=6), st.lists(_BOX, max_size=6))
def test_many_boxes_as_each_pair_alone(found: list[UprightBox], labelled: list[UprightBox]) -> None:
    every = overlaps(found, labelled)
    for i, j in np.ndindex(len(found), len(labelled)):
        alone = overlaps([found[i]], [labelled[j]])
        for table, one in zip(_tables(every), _tables(alone), strict=True):
            assert table[i, j] == pytest.approx(one[0, 0], abs=1e-12)


def test_boxes_without_an_extent_share_nothing() -> None:
    flat = CAR._replace(height=0.0)
    assert overlaps([flat], [flat]).space == 0
    assert overlaps([CAR._replace(width=0.0)], [CAR]).bev == 0


def test_no_boxes() -> None:
    assert overlaps([], [CAR]).bev.shape == (0, 1)
    assert overlaps([CAR], []).space.shape == (1, 0)


def _seen(yaw: float, rear: float = 4.0, side: float = 1.8) -> np.ndarray:
    """Points of two sides of a box, 1 m high, its near corner at (8, 3)."""
    a, b = np.linspace(0, rear, 60), np.linspace(0, side, 30)
    flat = np.concatenate((np.stack((a, 0 * a), 1), np.stack((0 * b, b), 1)))
    c, s = math.cos(yaw), math.sin(yaw)
    xy = flat @ np.array(((c, s), (-s, c))) + (8, 3)
    high = np.repeat((0.2, 1.2), len(xy))
    return np.column_stack((np.tile(xy, (2, 1)), high)).astype(np.float32)


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2, -0.7])
def test_two_sides_tell_the_box(yaw: float) -> None:
    """Not to the smallest rectangle: that along the line between their ends is as small."""
    found = l_shape(_seen(yaw))
    assert (found.length, found.width, found.height) == pytest.approx((4.0, 1.8, 1.0), abs=0.05)
    off = (found.yaw - yaw) % math.pi
    assert min(off, math.pi - off) < math.radians(0.6)
    c, s = math.cos(yaw), math.sin(yaw)
    middle = (8 + 2 * c - 0.9 * s, 3 + 2 * s + 0.9 * c)
    assert (found.x, found.y, found.z) == pytest.approx((*middle, 0.7), abs=0.03)


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2, -0.7])
def test_three_sides_tell_the_smallest_rectangle(yaw: float) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    other = _seen(yaw)[:90] + np.array((-1.8 * s, 1.8 * c, 0.0), np.float32)
    found = smallest_rectangle(np.concatenate((_seen(yaw), other[:60])))
    assert (found.length, found.width) == pytest.approx((4.0, 1.8), abs=0.05)
    off = (found.yaw - yaw) % math.pi
    assert min(off, math.pi - off) < math.radians(0.6)


def test_the_longer_side_is_the_length() -> None:
    found = l_shape(_seen(0.2, rear=1.8, side=4.0))
    assert found.length > found.width


def test_a_line_of_points_is_a_thin_box() -> None:
    line = np.column_stack((np.linspace(0, 4, 50), np.zeros(50), np.zeros(50)))
    found = l_shape(line.astype(np.float32))
    assert found.length == pytest.approx(4, abs=0.01)
    assert found.width > 0
    assert found.height > 0
