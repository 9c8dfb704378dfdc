# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The box of a completed shape, in the frame of the scan."""

from torch import Tensor

from wildshape.geometry.box import fit_box
from wildshape.geometry.rotation import quaternion_from_rotation
from wildshape.geometry.se3 import SE3
from wildshape.records import Box


def box_of(shape: Tensor, T_sensor_canonical: SE3) -> Box:
    """The box fitted to the canonical shape, carried to the sensor frame."""
    fitted = fit_box(shape)
    centre = T_sensor_canonical.apply(fitted.centre[None])[0]
    quaternion = quaternion_from_rotation(T_sensor_canonical.rotation @ fitted.rotation)
    x, y, z = _rounded(centre)
    length, width, height = _rounded(fitted.size)
    qw, qx, qy, qz = _rounded(quaternion)
    return Box((x, y, z), (length, width, height), (qw, qx, qy, qz))


def _rounded(values: Tensor) -> list[float]:
    return [round(value, 6) for value in values.tolist()]
