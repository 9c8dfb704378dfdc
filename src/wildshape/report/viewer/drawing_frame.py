# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where things stand in the drawing frame: z up, the object in the middle, metres.

Either each scan keeps the axes of its sensor, or the object is held still by somebody's poses.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import SensorKind

Hold = Literal["sensor", "object"]
_ROTATIONS = {
    "lidar": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "camera": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
}


def moved_by(offset: Sequence[float] | np.ndarray) -> SE3:
    """The translation by `offset`."""
    place = torch.as_tensor(np.asarray(offset, dtype=np.float64))
    return SE3(torch.eye(3, dtype=torch.float64), place)


def upright(kind: SensorKind) -> SE3:
    """`T_draw_sensor` without translation: a camera's y (down) becomes -z."""
    rotation = torch.tensor(_ROTATIONS[kind], dtype=torch.float64)
    return SE3(rotation, torch.zeros(3, dtype=torch.float64))


def draw_from_sensor(
    kind: SensorKind, centre: np.ndarray, middle: np.ndarray, T_middle_scan: SE3, hold: Hold
) -> SE3:
    """`T_draw_sensor` of a scan.

    Args:
        kind: of the sensor.
        centre: `(3,)` the object's middle in the scan's sensor frame, metres.
        middle: `(3,)` the same in the track's middle scan.
        T_middle_scan: of this scan: what holds the object still.
        hold: whether the sensor's axes or the object stand still.
    """
    if hold == "sensor":
        return upright(kind) @ moved_by(-centre)
    return upright(kind) @ moved_by(-middle) @ T_middle_scan


def draw_from_middle(T_draw_sensor: SE3, T_middle_scan: SE3) -> SE3:
    """`T_draw_middle`: of what is fused in the middle scan's frame, when a scan is shown."""
    return T_draw_sensor @ T_middle_scan.inverse()


def as_node(T: SE3) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Quaternion wxyz and position of one transform, as scene nodes take them."""
    wxyz = quaternion_from_rotation(T.rotation)
    return tuple(wxyz.tolist()), tuple(T.translation.tolist())
