# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scans of a vehicle that drives, as if all its points had been met at once.

Where points have times, scans are corrected for the sensor's motion. That puts points of what
stands where they belong; a vehicle drives on while the beam passes it. One that follows is met at
the beginning and at the end of a turn: its halves are as far apart as it drives in one.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from wildshape.drives.object_config import DeskewConfig
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points


def deskewed(
    clouds: Sequence[Points],
    seconds: Sequence[Float[np.ndarray, "_"]],
    times: Float[np.ndarray, "k"],
    T_level_cloud: SE3,
    config: DeskewConfig,
) -> list[Points]:
    """The clouds of an object, each carried to the mean time of its points by its own motion.

    Those of what stands, and a scan without times, stay as they are.

    Args:
        clouds: `(n, 3)` in some scans, in time order, metres.
        seconds: when each point was met, since the scan's time; empty if not known.
        times: of the scans, seconds.
        T_level_cloud: of each, to the level world.
        config: see there.
    """
    if len(clouds) < 2 or not any(map(len, seconds)):
        return list(clouds)
    middles = np.array([_middle(T_level_cloud[i], cloud) for i, cloud in enumerate(clouds)])
    since = np.array([float(one.mean()) if len(one) else 0.0 for one in seconds])
    met = times + since
    found = []
    for i, (cloud, at) in enumerate(zip(clouds, seconds)):
        velocity = _velocity(middles, met - met[i], config)
        if not len(at) or np.hypot(*velocity) < config.least_m_per_s:
            found.append(cloud)
            continue
        R = T_level_cloud[i].rotation.numpy()
        back = (since[i] - at)[:, None] * (R.T @ (*velocity, 0.0))
        found.append((cloud + back).astype(np.float32))
    return found


def _middle(T_level_cloud: SE3, cloud: Points) -> Float[np.ndarray, "2"]:
    """Between its ends, seen from above."""
    placed = T_level_cloud.apply_numpy(cloud)[:, :2]
    return (placed.min(0) + placed.max(0)) / 2


def _velocity(
    middles: Float[np.ndarray, "k 2"], since: Float[np.ndarray, "k"], config: DeskewConfig
) -> Float[np.ndarray, "2"]:
    """Of the line through the places around a moment, the nearer in time the heavier."""
    weight = np.exp(-((since / config.smooth_s) ** 2) / 2)
    off = since - np.average(since, weights=weight)
    spread = float(weight @ off**2)
    return (weight * off) @ middles / spread if spread > 0 else np.zeros(2)
