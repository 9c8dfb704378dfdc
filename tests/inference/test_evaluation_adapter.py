# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Evaluation asks for the shapes of scans and then for their poses: one look answers both."""

import numpy as np
import pytest
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import Predictor
from wildshape.records import Box, Completion, Sensor, SightLines

LIDAR = Sensor()


class Counting(Predictor):
    """Its poses are read off the scans; says how often it was asked."""

    def __init__(self):
        self.asked = 0  # no network is behind it

    def complete_many(self, scans, sensor=None, *, rays=()):
        return iter(self.complete_track(scans, sensor))

    def complete_track(self, scans, sensor=None, *, rays=()):
        self.asked += 1
        return [completion(scan) for scan in scans]


def completion(scan):
    turn = rotation_z(torch.tensor(float(scan[0, 0]), dtype=torch.float64))
    pose = SE3(turn, torch.tensor(scan[0], dtype=torch.float64))
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    return Completion(points=scan, pose=pose, box=box, confidence=0.5, branch=0, cost=0.1)


@pytest.mark.parametrize("track", [False, True])
def test_the_same_scans_are_looked_at_once(track):
    network = Counting()
    method = Learned(network, track)
    scans = [np.full((16, 3), i, np.float32) for i in range(3)]
    done = method.complete_many(scans, LIDAR)
    T_middle_scan = method.register_track([scan.copy() for scan in scans], LIDAR)
    assert network.asked == 1
    for i, one in enumerate(done):
        expected = done[1].pose @ one.pose.inverse()
        torch.testing.assert_close(T_middle_scan[i].matrix, expected.matrix)


def test_other_scans_another_sensor_and_changed_scans_are_looked_at_anew():
    network = Counting()
    method = Learned(network)
    scans = [np.full((16, 3), i, np.float32) for i in range(3)]
    method.complete_many(scans, LIDAR)
    method.complete_many(scans[:2], LIDAR)
    method.complete_many(scans, LIDAR)
    method.complete_many(scans, Sensor("camera"))
    assert network.asked == 4
    scans[0][0] = 0.7  # the caller's own array
    moved = method.register_track(scans, Sensor("camera"))
    assert network.asked == 5
    poses = [completion(scan).pose for scan in scans]
    torch.testing.assert_close(moved[0].matrix, (poses[1] @ poses[0].inverse()).matrix)


def test_with_other_rays_scans_are_looked_at_anew_and_poses_are_of_the_last_shapes():
    network = Counting()
    method = Learned(network)
    scans = [np.full((16, 3), i, np.float32) for i in range(3)]
    rays = [SightLines.of_returns(scan[:1] + 1.0) for scan in scans]
    method.complete_many(scans, LIDAR)
    method.complete_sighted(scans, LIDAR, rays)
    assert network.asked == 2
    method.complete_sighted(scans, LIDAR, rays)
    method.register_track(scans, LIDAR)
    assert network.asked == 2
    method.complete_many(scans, LIDAR)
    assert network.asked == 3
