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
from wildshape.records import Points

_SOME = 3  # scans that tell most objects


def carries_sensor(
    seen: Sightings, cuts: Path, T_world_sensor: SE3, nearest_m: float, config: OwnVehicleConfig
) -> bool:
    """Whether an object goes with the sensor and begins where the nearest points are cut off."""
    places = T_world_sensor.translation.numpy()[list(seen.frames)]
    if np.linalg.norm(places[-1] - places[0]) < config.way_m:
        return False
    some = np.linspace(0, len(seen.frames) - 1, _SOME).round().astype(int).tolist()
    reach_m = nearest_m + config.near_m
    if _median_nearest(seen.part(some).clouds(cuts)) > reach_m:  # most objects: by a few scans
        return False
    clouds = seen.clouds(cuts)
    if _median_nearest(clouds) > reach_m:
        return False
    middles = np.array([(cloud.min(0) + cloud.max(0))[:2] / 2 for cloud in clouds])
    away = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    return float(np.quantile(away, config.most)) < config.stays_m


def _median_nearest(clouds: list[Points]) -> float:
    """How far from the sensor, seen from above, an object begins in the middle scan by that."""
    return float(np.median([np.hypot(*cloud[:, :2].T).min() for cloud in clouds]))
