# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Waymo's range images turned into points: rows are beams, columns are azimuths, pixels have poses.

Row 0 looks highest; the middle column looks along the vehicle's x axis and azimuth falls from left
to right.
"""

import numpy as np
import torch
from jaxtyping import Bool, Float

from wildshape.geometry.transforms.se3 import SE3

Array = np.ndarray


def uniform_inclinations(low: float, high: float, rows: int) -> Float[Array, "H"]:
    """Inclination of each row's middle, radians, lowest first, where no table is given."""
    return low + (np.arange(rows) + 0.5) / rows * (high - low)


def points_of_pixels(
    ranges: Float[Array, "H W"], inclinations: Float[Array, "H"], T_vehicle_sensor: SE3
) -> tuple[Bool[Array, "H W"], Float[Array, "n 3"]]:
    """Which pixels saw something, and their points in the sensor's frame when each was taken.

    Args:
        ranges: metres; not positive where nothing came back.
        inclinations: of the beams, radians, lowest first, as the calibration lists them.
        T_vehicle_sensor: the columns count from the vehicle's x axis, not the sensor's.
    """
    columns = ranges.shape[1]
    turn = T_vehicle_sensor.rotation[:2, 0]
    correction = torch.atan2(turn[1], turn[0]).item()
    ratio = (columns - np.arange(columns) - 0.5) / columns
    azimuths = (2 * ratio - 1) * np.pi - correction
    seen = (ranges > 0) & (ranges < np.inf)
    row, column = np.nonzero(seen)
    azimuth, inclination = azimuths[column], inclinations[::-1][row]
    level = np.cos(inclination)
    directions = np.stack(
        (level * np.cos(azimuth), level * np.sin(azimuth), np.sin(inclination)), axis=1
    )
    return seen, directions * ranges[seen].astype(np.float64)[:, None]


def at_frame_time(
    points: Float[Array, "n 3"],
    pixel_poses: Float[Array, "n 6"],
    T_vehicle_sensor: SE3,
    T_world_vehicle: SE3,
) -> Float[Array, "n 3"]:
    """Points as a sensor would see them that took them all at the frame's own time.

    Args:
        points: in the sensor's frame when each pixel was taken, metres.
        pixel_poses: of the vehicle in the world then: roll, pitch, yaw in radians about x, y, z
            (applied in this order), and x, y, z in metres.
        T_vehicle_sensor: one pose.
        T_world_vehicle: at the frame's time, one pose.
    """
    turned = _moved(points, T_vehicle_sensor)
    poses = pixel_poses.astype(np.float64)
    for axis, (first, second) in enumerate(((1, 2), (2, 0), (0, 1))):
        _turn(turned, poses[:, axis], first, second)
    turned += poses[:, 3:]
    return _moved(turned, (T_world_vehicle @ T_vehicle_sensor).inverse())


def _moved(points: Float[Array, "n 3"], T_a_b: SE3) -> Float[Array, "n 3"]:
    # Not SE3.apply: torch takes ten times as long for a whole scan of float64.
    return points @ T_a_b.rotation.numpy().T + T_a_b.translation.numpy()


def _turn(points: Float[Array, "n 3"], angle: Float[Array, "n"], first: int, second: int) -> None:
    """Turn each point, in place, by its own angle, from axis `first` towards axis `second`."""
    cos, sin = np.cos(angle), np.sin(angle)
    one, other = points[:, first].copy(), points[:, second].copy()
    points[:, first] = cos * one - sin * other
    points[:, second] = sin * one + cos * other
