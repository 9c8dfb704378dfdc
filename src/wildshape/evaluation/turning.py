# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The three input protocols of METHOD 8: each scan turned on its own before a method sees it."""

import zlib
from dataclasses import replace
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.rotation import random_rotation, random_yaw
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Sensor, Track

Rotate = Literal["none", "yaw", "so3"]


def turn_track(track: Track, rotate: Rotate, seed: int) -> Track:
    """Each scan turned about its sensor's origin, its true pose along with it.

    The rotations depend on `seed` and the track's name alone, not on the order of the tracks.

    Args:
        track: as recorded.
        rotate: `none`, `yaw` (about the sensor's vertical: z of a LiDAR, y of a camera) or `so3`
            (uniform over all rotations).
        seed: of the draw.
    """
    if rotate == "none":
        return track
    generator = torch.Generator().manual_seed(zlib.crc32(f"{seed}/{track.name}".encode()))
    draw = _yaw(len(track.scans), track.sensor, generator)
    if rotate == "so3":
        draw = random_rotation(len(track.scans), generator)
    turn = SE3(draw.double(), torch.zeros(len(track.scans), 3, dtype=torch.float64))
    poses = track.T_sensor_object
    return replace(
        track,
        scans=tuple(turn[i].apply_numpy(scan) for i, scan in enumerate(track.scans)),
        T_sensor_object=None if poses is None else turn @ poses,
    )


def _yaw(count: int, sensor: Sensor, generator: torch.Generator) -> Float[Tensor, "count 3 3"]:
    about_z = random_yaw(count, generator)
    if sensor.kind == "lidar":
        return about_z
    # Relabelled axes (y, z, x): the same turn about y.
    order = torch.tensor([1, 2, 0])
    return about_z[:, order][:, :, order]
