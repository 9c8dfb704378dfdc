# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What drives, by its points alone or by its boxes, and what does not."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.drives.cuts import write_cut
from tests.drives.objects import completed, still

from wildshape.drives.completing.driving import drives
from wildshape.drives.completing.vehicles import surer_if_driving
from wildshape.drives.object_config import BoxConfig, DrivingConfig, VehicleConfig
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3

TICKS = np.arange(0, 40, 4)
CONFIG = DrivingConfig()


def rear(height):
    """Of a lorry, as behind it: a wall of 2.2 m across the road."""
    return np.random.default_rng(0).uniform((0, -1.1, -1), (0.1, 1.1, height - 1), (80, 3))


def seen(ways, sensor_m=0.0, turn=0.0, height=2.4):
    """The clouds and `T_level_cloud` of something that is so far along x in each scan."""
    at = sensor_m * np.arange(len(ways))
    R = rotation_z(torch.full((len(ways),), turn, dtype=torch.float64))
    places = np.column_stack((at, 0 * at, 0 * at))
    T_level_cloud = SE3(R, torch.from_numpy(places))
    T_cloud_level = T_level_cloud.inverse()
    wall = rear(height)
    clouds = [
        T_cloud_level[i].apply_numpy((wall + np.array((way, 5.0, 0.0))).astype(np.float32))
        for i, way in enumerate(ways)
    ]
    return clouds, T_level_cloud


@pytest.mark.parametrize("sensor_m", [0.0, 3.0])
@pytest.mark.parametrize("turn", [0.0, 2.0])
def test_what_goes_on_and_on_drives_however_the_sensor_moves(sensor_m, turn):
    assert drives(*seen(0.8 * TICKS, sensor_m, turn), TICKS, CONFIG)
    assert drives(*seen(20 - 0.8 * TICKS, sensor_m, turn), TICKS, CONFIG)


@pytest.mark.parametrize(
    ("ways", "height"),
    [
        (0 * TICKS, 2.4),
        (0.15 * TICKS, 2.4),
        (0.8 * TICKS, 0.8),
        (np.where(TICKS < 20, 0.0, 20.0), 2.4),
        (0.8 * np.abs(TICKS - 12), 2.4),
    ],
    ids=["stands", "is slow", "is low", "jumps once", "turns back"],
)
def test_what_else_does_not(ways, height):
    assert not drives(*seen(ways, 1.0, height=height), TICKS, CONFIG)


def test_two_scans_tell_nothing():
    clouds, T_level_cloud = seen(np.array((0.0, 20.0)))
    assert not drives(clouds, T_level_cloud, np.array((0, 20)), CONFIG)


@pytest.mark.parametrize(
    ("step", "off", "p_kind", "sides", "surer"),
    [
        (0.5, 0.1, 0.5, (0.1, 0.1), True),
        (0.5, math.pi, 0.5, (0.1, 0.1), True),
        (0.5, math.pi / 2, 0.5, (4.0, 1.8), False),  # sideways
        (0.0, 0.1, 0.5, (4.0, 1.8), False),
        (0.5, 0.1, 0.3, (4.0, 1.8), False),  # not far enough for so small a probability
        (0.8, 0.1, 0.3, (0.1, 1.8), True),  # a car from behind
        (0.8, math.pi, 0.3, (4.0, 0.1), True),  # and from the side
        (0.8, math.pi / 2, 0.3, (4.0, 1.8), False),
        (0.8, 0.1, 0.01, (4.0, 1.8), False),
        (0.8, 0.1, 0.3, (1.8, 0.6), False),  # a cyclist
    ],
)
@pytest.mark.parametrize("course", [0.0, 1.0, -2.5])
def test_what_drives_where_it_looks_is_a_vehicle_whatever_its_shape(
    tmp_path, step, off, p_kind, sides, surer, course
):
    config, frames = VehicleConfig(), tuple(range(0, 20, 4))
    ahead = np.array((math.cos(course), math.sin(course)))
    beside = np.array((-ahead[1], ahead[0]))
    corners = np.array(((-1, -1), (-1, 1), (1, -1), (1, 1))) / 2 * sides
    for frame in range(frames[-1] + 1):
        places = step * frame * ahead + corners @ np.stack((ahead, beside))
        write_cut(tmp_path, frame, [np.column_stack((places, (-0.5, 0.5, 0.5, -0.5)))], 4)
    boxes = [(*(step * frame * ahead), 0.0, course + off) for frame in frames]
    one = replace(completed(boxes, frames), p_kind=p_kind, confidence=0.1)
    found = surer_if_driving(one, tmp_path, still(20), BoxConfig(), config)
    assert found.p_kind == (config.driving_kind if surer else p_kind)
    assert (found.confidence > one.confidence) == surer
