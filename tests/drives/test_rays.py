# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rays beside the objects of a drive: where they start and end, and who gets them."""

from pathlib import Path

import numpy as np
import pytest
import torch
from tests.drives.cuts import write_cut

import wildshape
from wildshape.drives.clock import Clock, silent
from wildshape.drives.config import DriveConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.result import DriveResult
from wildshape.drives.source import Drive
from wildshape.drives.tracking.rays import RayCutter
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3
from wildshape.parallel.team import ALONE
from wildshape.records import Turn

SPEED, FRAMES, POINTS = 20.0, 3, 4000
NOTHING = DriveResult(Path(), 0, 0, (), 0, 0, (), {})
OBJECTS = ((0,), (1,), (0, 1))


@pytest.fixture
def moving(tmp_path):
    """Scans from a sensor that drives along x; what stands is given in frame 0's axes."""
    rng = np.random.default_rng(0)
    T_world_sensor = SE3(
        torch.eye(3).double().expand(FRAMES, 3, 3),
        torch.tensor([[SPEED * 0.1 * i, 0.0, 0.0] for i in range(FRAMES)]).double(),
    )
    world = [rng.uniform((-30, -30, -2), (40, 30, 3), (POINTS, 3)) for _ in range(FRAMES)]
    seconds = rng.uniform(-0.05, 0.05, (FRAMES, POINTS))
    seconds[:, :2] = 0.0499
    turns = []
    for frame in range(FRAMES):
        world[frame][:3] = np.array((9.0, 3.0, 0.0)) + rng.normal(0, 0.2, (3, 3))
        world[frame][3:6] = np.array((10.0, 4.0, 0.0)) + rng.normal(0, 0.2, (3, 3))
        places = SPEED * (0.1 * frame + seconds[frame])
        seen = (world[frame] - places[:, None] * (1.0, 0.0, 0.0)).astype(np.float32)
        seen[-50:] = 0.0  # nothing came back
        turns.append(Turn(seen, seconds[frame]))
        write_cut(tmp_path, frame, (seen[:3], seen[3:6]), POINTS)
    drive = Drive.of("street", ["a", "b", "c"], turns.__getitem__, [0.0, 0.1, 0.2])
    return drive, T_world_sensor, world, seconds


def test_rays_start_where_the_sensor_was_and_end_where_points_are(moving, tmp_path):
    drive, T_world_sensor, world, seconds = moving
    drive = drive.moved_by(T_world_sensor)
    at = np.array((SPEED * 0.1, 0.0, 0.0))
    for rays, clusters in zip(RayCutter(drive, tmp_path).in_frame(1, OBJECTS), OBJECTS):
        assert rays is not None
        assert len(rays) > 100
        own = [row for cluster in clusters for row in range(3 * cluster, 3 * cluster + 3)]
        apart = np.linalg.norm(rays.ends[:, None] - (world[1] - at), axis=2)
        rows = apart.argmin(1)
        assert apart.min(1).max() < 1e-3
        assert not set(rows.tolist()) & {*own, *range(POINTS - 50, POINTS)}
        assert np.abs(rays.starts[:, 0] - SPEED * seconds[1][rows]).max() < SPEED * 0.00501
        assert not rays.starts[:, 1:].any()
        assert len(np.unique(rays.starts[:, 0])) <= 11


def test_each_object_gets_the_rays_of_its_own_frame_and_a_scan_is_read_once(moving, tmp_path):
    drive, T_world_sensor, *_ = moving
    read, frames = drive.read, []
    object.__setattr__(drive, "read", lambda frame: frames.append(frame) or read(frame))
    cutter = RayCutter(drive.moved_by(T_world_sensor), tmp_path)
    ones = [Sightings("a", (0, 2), ((0,), (0, 1)), (3, 6)), Sightings("b", (2,), ((1,),), (3,))]
    found = cutter.of([(ones[0], 0), (ones[1], 0), (ones[0], 1)])
    cutter.of([(ones[0], 1)])
    assert sorted(frames) == [0, 2]
    alone = [cutter.in_frame(0, [(0,)]), cutter.in_frame(2, [(1,)]), cutter.in_frame(2, [(0, 1)])]
    for rays, (expected,) in zip(found, alone):
        assert rays is not None
        assert expected is not None
        assert np.array_equal(rays.ends, expected.ends)
    object.__setattr__(drive, "read", lambda frame: Turn(read(frame).points[:9]))
    assert RayCutter(drive, tmp_path).in_frame(0, OBJECTS) == [None] * 3


def test_all_that_follows_the_trajectory_sees_scans_corrected_by_it(moving, tmp_path, monkeypatch):
    drive, T_world_sensor, *_ = moving
    followed = []
    monkeypatch.setattr(Pipeline, "mounting", lambda _: None)
    monkeypatch.setattr(Pipeline, "trajectory", lambda *_: T_world_sensor)
    monkeypatch.setattr(Pipeline, "find", lambda one, *_: followed.append(one.drive) or NOTHING)
    clock = Clock(silent)
    Pipeline(drive, tmp_path, DriveConfig(), wildshape.load(), ALONE, None, clock).perform()
    (found,) = followed
    assert not np.array_equal(found.scan(1), drive.scan(1))
    assert np.array_equal(found.scan(1), drive.moved_by(T_world_sensor).scan(1))
