# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether an object drives, by its points alone.

Of a lorry from behind or ahead a scan shows a flat wall, in which a network sees no vehicle. But
what is as high and goes on and on one way is one more often than not, and worth a longer look.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from wildshape.drives.object_config import DrivingConfig
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points


def drives(
    clouds: Sequence[Points],
    T_level_cloud: SE3,
    ticks: Int[np.ndarray, "k"],
    config: DrivingConfig,
) -> bool:
    """Whether what is seen goes far, fast and one way in every step, and is as high as a vehicle.

    Args:
        clouds: `(n, 3)` of an object in some scans, in time order, metres.
        T_level_cloud: of each, to the level world.
        ticks: of each.
        config: see there.
    """
    if len(clouds) < config.fewest_scans:
        return False
    placed = [T_level_cloud[i].apply_numpy(cloud) for i, cloud in enumerate(clouds)]
    low, high = (np.array([end(cloud, axis=0) for cloud in placed]) for end in (np.min, np.max))
    middles = (low + high)[:, :2] / 2
    way = middles[-1] - middles[0]
    far = float(np.hypot(*way))
    speed = far / float(ticks[-1] - ticks[0])
    if far < config.way_m or speed < config.m_per_tick:
        return False
    ahead = np.diff(middles, axis=0) @ way / far / np.diff(ticks)
    tall = float(np.median((high - low)[:, 2]))
    return tall >= config.tall_m and bool(ahead.min() > config.steady * speed)
