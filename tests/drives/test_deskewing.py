# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points of vehicles that drive, met at different times, carried to one."""

import numpy as np
import pytest
import torch

from wildshape.drives.completing.deskewing import deskewed
from wildshape.drives.object_config import DeskewConfig
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3

CONFIG = DeskewConfig()
STEP_S = 0.4  # between scans


def follower(speed, scans=6):
    """The front of a car behind the sensor: its left half ends a turn, its right half begins it.

    Returns the clouds, the times of their points, those of the scans, `T_level_cloud`, and each
    cloud as the front stands at the mean of its times. The level world is turned and moved against
    the sensor.
    """
    rng = np.random.default_rng(0)
    front = rng.uniform((-10.2, -0.9, 0), (-10.0, 0.9, 1.4), (300, 3))
    met = np.where(front[:, 1] > 0, 0.05, -0.05) + rng.uniform(-0.005, 0.005, 300)
    along = np.array((1.0, 0.0, 0.0))
    clouds, whole, places = [], [], []
    for scan in range(scans):
        drives = speed * (STEP_S * scan + met[:, None])
        ahead = speed * STEP_S * scan  # the sensor goes as fast
        places.append(ahead * along)
        clouds.append((front + (drives - ahead) * along).astype(np.float32))
        whole.append(front + speed * met.mean() * along)
    R = rotation_z(torch.tensor(0.7, dtype=torch.float64))
    T_level_world = SE3(R, torch.tensor((3.0, -2.0, 1.0), dtype=torch.float64))
    T_world_cloud = SE3(torch.eye(3).double().expand(scans, 3, 3), torch.tensor(np.array(places)))
    return clouds, [met] * scans, STEP_S * np.arange(scans), T_level_world @ T_world_cloud, whole


def test_the_halves_of_a_vehicle_that_follows_are_put_together():
    clouds, seconds, times, T_level_cloud, whole = follower(8.0)
    apart = [np.abs(one - two).max() for one, two in zip(clouds, whole)]
    assert min(apart) > 0.35
    found = deskewed(clouds, seconds, times, T_level_cloud, CONFIG)
    for one, two in zip(found, whole, strict=True):
        np.testing.assert_allclose(one, two, atol=1e-4)
        assert one.dtype == np.float32


@pytest.mark.parametrize("slow", [0.0, 2.0])
def test_what_stands_stays(slow):
    """The middle of what is seen of a parked car moves, as more of it comes into sight."""
    clouds, seconds, times, T_level_cloud, _ = follower(slow)
    found = deskewed(clouds, seconds, times, T_level_cloud, CONFIG)
    assert all(one is two for one, two in zip(found, clouds, strict=True))


def test_without_times_or_with_one_scan_all_stays():
    clouds, seconds, times, T_level_cloud, _ = follower(8.0)
    unknown = [np.empty(0) for _ in clouds]
    assert deskewed(clouds, unknown, times, T_level_cloud, CONFIG) == clouds
    assert deskewed(clouds[:1], seconds[:1], times[:1], T_level_cloud[:1], CONFIG) == clouds[:1]


def test_a_scan_without_times_stays_and_the_others_do_not():
    clouds, seconds, times, T_level_cloud, whole = follower(8.0)
    seconds[2] = np.empty(0)
    found = deskewed(clouds, seconds, times, T_level_cloud, CONFIG)
    assert found[2] is clouds[2]
    np.testing.assert_allclose(found[4], whole[4], atol=0.01)  # of 0.4
