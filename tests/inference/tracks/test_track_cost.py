# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a shape costs in each scan of a track, however many scans are looked at at once."""

import torch
from tests.cars import car_surface, drive_by, poses_of
from tests.models import SETTINGS

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks import track_cost as module
from wildshape.inference.tracks.track_cost import network_inputs, track_cost

TRACK = drive_by(scans=5, step=2.0, heading=0.3, side=5.0)
SHAPE = torch.from_numpy(car_surface(600)[0])


def costs(poses):
    return track_cost(SHAPE, poses, network_inputs(list(TRACK.scans), SETTINGS), SETTINGS)


def test_each_scan_is_held_against_its_own_pose(monkeypatch):
    true = poses_of(TRACK)
    shift = torch.zeros(5, 3, dtype=torch.float64)
    shift[3, 2] = 1.0
    moved = SE3(true.rotation, true.translation + shift)
    right, off = costs(true), costs(moved)
    assert right.shape == (5,)
    assert torch.nonzero(off > right + 0.3)[:, 0].tolist() == [3]
    monkeypatch.setattr(module, "_BATCH", 2)
    torch.testing.assert_close(costs(moved), off)
