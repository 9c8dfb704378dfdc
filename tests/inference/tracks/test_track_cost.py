# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a shape costs in each scan of a track, however many scans are looked at at once."""

from dataclasses import replace

import torch
from tests.cars import car_surface, drive_by, poses_of
from tests.models import SETTINGS

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks import track_cost as module
from wildshape.inference.tracks.track_cost import network_inputs, track_cost

TRACK = drive_by(scans=5, step=2.0, heading=0.3, side=5.0)
SHAPE = torch.from_numpy(car_surface(600)[0])


def costs(poses, settings=SETTINGS):
    return track_cost(SHAPE, poses, network_inputs(list(TRACK.scans), settings), settings)


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


def test_a_shape_costs_as_much_where_scans_are_turned_towards_it():
    facing = replace(SETTINGS, facing=True)
    turned = [inputs.turn for inputs in network_inputs(list(TRACK.scans), facing)]
    assert float((turned[0] - torch.eye(3)).abs().amax()) > 0.5
    plain, found = costs(poses_of(TRACK)), costs(poses_of(TRACK), facing)
    torch.testing.assert_close(found, plain, atol=0.03, rtol=0)
