# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The vehicle that carries the sensor, where more of it is seen than the nearest points cut off.

A bonnet or a load platform that reaches beyond them goes the sensor's way, like a vehicle close by.
"""

from pathlib import Path

import numpy as np

from wildshape.drives.object_config import OwnVehicleConfig
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3


def carries_sensor(
    seen: Sightings, cuts: Path, T_world_sensor: SE3, nearest_m: float, config: OwnVehicleConfig
) -> bool:
    """Whether an object goes with the sensor and begins where the nearest points are cut off.

    Args:
        seen: the object.
        cuts: folder of the clusters.
        T_world_sensor: of every frame.
        nearest_m: nearer points were cut off.
        config: see there.
    """
    places = T_world_sensor.translation.numpy()[list(seen.frames)]
    if np.linalg.norm(places[-1] - places[0]) < config.way_m:
        return False
    clouds = [cloud[:, :2] for cloud in seen.clouds(cuts)]
    nearest = [float(np.hypot(*cloud.T).min()) for cloud in clouds]
    if np.median(nearest) > nearest_m + config.near_m:
        return False
    middles = np.array([(cloud.min(0) + cloud.max(0)) / 2 for cloud in clouds])
    away = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    return float(np.quantile(away, config.most)) < config.stays_m
