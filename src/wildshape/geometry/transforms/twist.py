# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A steady motion, and points carried along it: how a scan is corrected for the sensor's motion.

The exponential map of SE(3): Sola, Deray and Atchuthan, "A micro Lie theory", 2018, eq. 145, 174.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3

_SLOW = 1e-9  # radians a second: no turn that a scan shows


@dataclass(frozen=True)
class Twist:
    """A motion of steady speed and turn, seen from the moving frame.

    Attributes:
        angular: radians a second about the frame's axes.
        linear: metres a second along them.
    """

    angular: tuple[float, float, float]
    linear: tuple[float, float, float]

    @classmethod
    def between(cls, start: SE3, end: SE3, seconds: float) -> "Twist":
        """The steady motion from one pose `T_a_b` to another.

        Args:
            start: one pose.
            end: one pose, `seconds` later.
            seconds: not 0.
        """
        T_start_end = start.inverse() @ end
        cosine, *axis = quaternion_from_rotation(T_start_end.rotation).tolist()
        sine = math.hypot(*axis)
        turn = np.array(axis) * (2 * math.atan2(sine, cosine) / sine if sine else 2.0)
        # Columns: where each axis would be carried.
        carried = np.stack([_carried(turn, axis, np.ones(1))[0] for axis in np.eye(3)], axis=1)
        way = np.linalg.solve(carried, T_start_end.translation.numpy())
        (wx, wy, wz), (x, y, z) = (turn / seconds).tolist(), (way / seconds).tolist()
        return cls((wx, wy, wz), (x, y, z))

    def after(self, seconds: float) -> SE3:
        """`T_b_c`: where the frame is after some time, seen from where it was."""
        turn, linear = np.asarray(self.angular), np.asarray(self.linear)
        axes = _turned(turn, np.eye(3), np.full(3, seconds))
        (origin,) = _carried(turn, linear, np.full(1, seconds))
        return SE3(torch.from_numpy(axes.T.copy()), torch.from_numpy(origin))

    def carry(
        self, points: Float[np.ndarray, "n 3"], seconds: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "n 3"]:
        """Points where they are seen from the frame at time 0; in the array's own type.

        Args:
            points: each seen from the moving frame at its own time, metres.
            seconds: that time.
        """
        turn, linear = np.asarray(self.angular), np.asarray(self.linear)
        since = seconds.astype(np.float64)
        moved = _turned(turn, points.astype(np.float64), since) + _carried(turn, linear, since)
        return moved.astype(points.dtype)


STANDING = Twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _turned(
    turn: Float[np.ndarray, "3"],
    points: Float[np.ndarray, "n 3"],
    seconds: Float[np.ndarray, "n"],
) -> Float[np.ndarray, "n 3"]:
    """Rodrigues' formula, each point by its own angle."""
    speed = float(np.linalg.norm(turn))
    if speed < _SLOW:
        return points
    axis, angle = turn / speed, (speed * seconds)[:, None]
    across = np.cross(axis, points)
    along = (points @ axis)[:, None] * axis
    return along + np.cos(angle) * (points - along) + np.sin(angle) * across


def _carried(
    turn: Float[np.ndarray, "3"], linear: Float[np.ndarray, "3"], seconds: Float[np.ndarray, "m"]
) -> Float[np.ndarray, "m 3"]:
    """How far the origin gets in each time: the integral of the turned velocity."""
    speed, since = float(np.linalg.norm(turn)), seconds[:, None]
    if speed < _SLOW:
        return since * linear
    axis, angle = turn / speed, speed * since
    along = (linear @ axis) * axis
    circle = np.sin(angle) * (linear - along) + (1 - np.cos(angle)) * np.cross(axis, linear)
    return since * along + circle / speed
