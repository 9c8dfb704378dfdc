# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which way views look, asked of weights that learned it from another sensor (beyond the paper).

A car's two ends are too alike for views that come in no order: a network poses nearly all of them
right but for half turns. Scans of a passing LiDAR come in order, and a network trained on them
knows front from rear. Each view is stood upright by its own pose, put where a passing LiDAR would
have seen that side of a vehicle, and the other network is asked which way it looks. It has learned
from scans alone, too: no label enters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import Predictor
from wildshape.records import Points


@dataclass(frozen=True)
class TransferConfig:
    """Where a passing LiDAR would have stood, for objects as large as vehicles.

    Attributes:
        away_m: from the object's middle, as far as most cars are seen from.
        above_m: above it; LiDARs stand on roofs.
    """

    away_m: float = 10.0
    above_m: float = 1.0


_DEFAULT = TransferConfig()


def check_transfer(asked: Predictor) -> None:
    """Refuse weights that know nothing of scans in order.

    Raises:
        BadInputError: they are not of a LiDAR.
    """
    if asked.settings.sensor != "lidar":
        raise BadInputError(
            "--headings: these weights were trained on views of a camera, expected those of a"
            " LiDAR, whose scans come in order; pass `shipped`, or a checkpoint of LiDAR tracks."
        )


@torch.no_grad()
def transferred_signs(
    asked: Predictor,
    scans: Sequence[Points],
    T_sensor_can: SE3,
    config: TransferConfig = _DEFAULT,
) -> Float[Tensor, "V"]:
    """+1 for each view posed as the other network would have it, -1 if the other way round.

    Args:
        asked: trained on LiDAR scans.
        scans: sensor frames, of an object as large as a vehicle (`unit_of`).
        T_sensor_can: of each, z up, right but for half turns about z.
        config: where the LiDAR is thought to stand.
    """
    T_can_sensor = T_sensor_can.to(torch.float64).inverse()
    T_lidar_can = _beside(T_can_sensor.translation, config)
    T_lidar_sensor = T_lidar_can @ T_can_sensor
    placed = [T_lidar_sensor[i].apply_numpy(scan) for i, scan in enumerate(scans)]
    looks = [done.pose.rotation.to(torch.float64)[:, 0] for done in asked.complete_many(placed)]
    cosine = (T_lidar_can.rotation[:, :, 0] * torch.stack(looks)).sum(-1)
    return torch.where(cosine < 0, -1.0, 1.0)


def _beside(sensors: Float[Tensor, "V 3"], config: TransferConfig = _DEFAULT) -> SE3:
    """`T_lidar_canonical` of level LiDARs beside the object, in the directions of the sensors.

    x of each points at the object, z up.
    """
    towards = -sensors * torch.tensor((1.0, 1.0, 0.0), dtype=torch.float64)
    length = towards.norm(dim=-1, keepdim=True)
    ahead = torch.tensor((1.0, 0.0, 0.0), dtype=torch.float64)
    x = torch.where(length < np.finfo(float).eps, ahead, towards / length.clamp_min(1e-12))
    z = torch.tensor((0.0, 0.0, 1.0), dtype=torch.float64).expand_as(x)
    rotation = torch.stack((x, torch.linalg.cross(z, x), z), dim=-2)
    away = torch.tensor((config.away_m, 0.0, -config.above_m), dtype=torch.float64)
    return SE3(rotation, away.expand(len(x), 3))
