# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays that pass beside a vehicle say where it ends."""

import numpy as np
import pytest
import torch

from wildshape.drives.completing.free_space_length import Carving
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.completing.whole_scans import show_scans
from wildshape.drives.config import CarveConfig
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3

_SENSOR = np.array((0.0, 0.0, 1.7))
_PLACE = np.array((3.0, -5.0))  # of a block of 4 x 1.8 x 1.5 m, seen from its left and behind
_TRUE = (4.0, 1.8, 1.5)


def scan(blocked=False):
    """A turn of the sensor: rays end on the block, on what hides its far corner, or far away."""
    azimuth, elevation = np.meshgrid(
        np.deg2rad(np.arange(-100, 20, 0.2)), np.deg2rad(np.arange(-24, 2, 0.4))
    )
    rays = np.stack(
        (
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ),
        axis=-1,
    ).reshape(-1, 3)
    middle = np.array((*_PLACE, _TRUE[2] / 2))
    walls = (middle - np.array(_TRUE) / 2 - _SENSOR, middle + np.array(_TRUE) / 2 - _SENSOR)
    first, last = (
        np.stack([w / rays for w in walls]).min(0),
        np.stack([w / rays for w in walls]).max(0),
    )
    enters, leaves = first.max(1), last.min(1)
    length = np.where((enters < leaves) & (enters > 0), enters, 40.0)
    if blocked:
        beyond = np.arctan2(rays[:, 1], rays[:, 0]) > np.arctan2(-4.1, 4.9)
        length[beyond] = 6.0
    return (rays * length[:, None]).astype(np.float32)


def found(length):
    """A vehicle whose box is right at the rear and `length` metres long."""
    box = (_PLACE[0] + (length - _TRUE[0]) / 2, _PLACE[1], _TRUE[2] / 2 - _SENSOR[2], 0.0)
    seen = Sightings("a", (0,), ((0,),), (500,))
    return Completed(seen, (0,), np.array([box]), (length, 1.8, 1.5), 0.1, 0.5)


def carved(length, **scene):
    still = Turns((0,), SE3(torch.eye(3).double()[None], torch.zeros(1, 3).double()))
    carving = Carving([found(length)], still, CarveConfig())
    show_scans(lambda _: scan(**scene), still, carving)
    (one,) = carving.carved()
    return one


def test_an_end_that_rays_pass_through_is_drawn_inwards():
    config = CarveConfig()
    one = carved(4.7)
    assert one.size == pytest.approx((4.7 - config.most_m, 1.8, 1.5))
    rear = one.boxes[0, 0] - one.size[0] / 2
    assert rear == pytest.approx(_PLACE[0] - _TRUE[0] / 2)  # where its points are it stays
    assert one.moved_m == pytest.approx((-config.most_m / 2, 0.0, 0.0))


def test_a_box_that_fits_stays_and_so_does_one_whose_end_is_hidden():
    assert carved(4.0).size[0] == pytest.approx(4.0)
    assert carved(4.7, blocked=True).size[0] == pytest.approx(4.7)
