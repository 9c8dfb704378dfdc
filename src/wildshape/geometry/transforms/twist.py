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
from wildshape.geometry.transforms.se3 import ROWS, SE3

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
        origin = np.zeros((1, 3))  # columns: where it would be carried along each axis
        carried = np.concatenate([_moved(origin, turn, a, np.ones(1)) for a in np.eye(3)]).T
        way = np.linalg.solve(carried, T_start_end.translation.numpy())
        (wx, wy, wz), (x, y, z) = (turn / seconds).tolist(), (way / seconds).tolist()
        return cls((wx, wy, wz), (x, y, z))

    def after(self, seconds: float) -> SE3:
        """`T_b_c`: where the frame is after some time, seen from where it was."""
        turn, linear = np.asarray(self.angular), np.asarray(self.linear)
        axes = _moved(np.eye(3), turn, np.zeros(3), np.full(3, seconds))
        (origin,) = _moved(np.zeros((1, 3)), turn, linear, np.full(1, seconds))
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
        moved = np.empty_like(points)
        for start in range(0, len(points), ROWS):
            part = slice(start, start + ROWS)
            some, since = points[part].astype(np.float64), seconds[part].astype(np.float64)
            moved[part] = _moved(some, turn, linear, since)
        return moved


STANDING = Twist((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def _moved(
    points: Float[np.ndarray, "n 3"],
    turn: Float[np.ndarray, "3"],
    linear: Float[np.ndarray, "3"],
    seconds: Float[np.ndarray, "n"],
) -> Float[np.ndarray, "n 3"]:
    """Rodrigues' formula, each point by its own angle, and the integral of the turned velocity."""
    speed, since = float(np.linalg.norm(turn)), seconds[:, None]
    if speed < _SLOW:
        return points + since * linear
    axis = turn / speed
    cosine, sine = np.cos(speed * since), np.sin(speed * since)
    along = (points @ axis)[:, None] * axis
    across = points @ np.cross(axis, np.eye(3))  # the axis times each point
    turned = along + cosine * (points - along) + sine * across
    ahead = (linear @ axis) * axis
    circle = sine * (linear - ahead) + (1 - cosine) * np.cross(axis, linear)
    return turned + since * ahead + circle / speed
