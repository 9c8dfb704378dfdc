# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that jumps, one that stands, and objects in place of scans."""

import numpy as np
import pytest
from tests.drives.street import street
from tests.refusal import refused

from wildshape.drives.config import DriveConfig, LinkConfig, MountingConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.mounting import Mounting, find_mounting
from wildshape.drives.tracking.trajectory import Breaks, find_trajectory
from wildshape.records import Turn

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")

LEVEL = Mounting(1.7, 0.0, (0.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def scans():
    return street(frames=4).scans


def drive_of(scans):
    names = [f"{frame:06d}" for frame in range(len(scans))]
    return Drive.of("street", names, lambda frame: Turn(scans[frame]))


def test_the_way_breaks_off_where_a_scan_was_taken_elsewhere(scans):
    far = np.array((30.0, 0.0, 0.0), np.float32)
    jumped = [*scans[:2], *(scan + far for scan in scans[2:])]
    way = find_trajectory(drive_of(jumped), LEVEL, DriveConfig())
    assert way.breaks.frames == (2,)
    (told,) = way.breaks.told()
    assert "breaks off 1 times, first at frame 2" in told
    steps = np.linalg.norm(np.diff(way.T_world_sensor.translation.numpy(), axis=0), axis=1)
    assert steps[1] == pytest.approx(steps[0])  # it goes on as it went before
    assert Breaks((2,)).ticks((0, 1, 2, 3), LinkConfig(longest_gap=4)) == [0, 1, 7, 8]


def test_a_sensor_that_stands_stays_where_it_is(scans):
    way = find_trajectory(drive_of([scans[0]] * 3), LEVEL, DriveConfig())
    assert (way.breaks.frames, way.breaks.told()) == ((), [])
    assert way.T_world_sensor.translation.abs().max() < 0.01


def test_scans_of_objects_are_refused(scans):
    car = [scan[(np.abs(scan - (9, -4, -1)) < (3, 2, 1.2)).all(1)] for scan in scans]
    refused(find_mounting, drive_of(car), MountingConfig(), match="single objects, cut out")
    assert find_mounting(drive_of(scans), MountingConfig()).height_m == pytest.approx(1.7, abs=0.05)
