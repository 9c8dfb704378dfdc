# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track of a car whose shape is known, and its scans completed as by a network that knows it."""

from dataclasses import replace

import torch
from tests.cars import car_surface, drive_by, poses_of
from tests.models import SETTINGS

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.boxes import carried, fit_to_scans
from wildshape.inference.tracks import complete_track as whole
from wildshape.inference.tracks.heading_vote import half_turn
from wildshape.records import Completion

TRACK = drive_by(scans=7, step=2.0, heading=0.3, side=5.0)
SHAPE = torch.from_numpy(car_surface(2000)[0])
BOX = fit_to_scans(SHAPE, [], mirror=True)


def completed(poses):
    """As a network would that knows the car's shape, but not quite its pose."""
    return [
        Completion(
            poses[i].apply(SHAPE).float().numpy(), poses[i], carried(BOX, poses[i]), 0.5, 0, 0.1
        )
        for i in range(len(poses))
    ]


def together(done, scans, settings=SETTINGS, rays=(), motion=None):
    gathered = whole.Gathered(settings)
    for item, scan in zip(done, scans):
        gathered.add(item, scan)
    return list(whole.complete_together(gathered, rays=rays, motion=motion))


def turned_around(poses, rows):
    back = poses @ half_turn(0.0)
    return stack([back[i] if i in rows else poses[i] for i in range(len(poses))])


def each_turned(track, generator):
    """Every scan turned by its own yaw."""
    yaw = 6.28 * torch.rand(len(track.scans), generator=generator, dtype=torch.float64)
    turn = SE3(rotation_z(yaw), torch.zeros(len(yaw), 3, dtype=torch.float64))
    scans = tuple(turn[i].apply_numpy(scan) for i, scan in enumerate(track.scans))
    return replace(track, scans=scans, T_sensor_object=turn @ poses_of(track))
