# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A small network, its settings, and a scan for it."""

import numpy as np

from wildshape.geometry.projection.visibility import FacingBins
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.network import NetworkConfig

CONFIG = NetworkConfig(
    encoder=(16, 16, 32, 32), decoder=(32, 32), pose=(16, 16), points=600, mirror=True, scale=2.0
)

SETTINGS = ModelSettings(
    network=CONFIG,
    sensor="lidar",
    input_points=128,
    projection=FacingBins(0.3),
    beta=0.25,
    extent_m=(2.0, 6.0),
    cost_m=(0.1, 0.3),
)


def scan(seed=0, count=200):
    rng = np.random.default_rng(seed)
    at = np.array([9.0 + rng.uniform(-2, 2), rng.uniform(-3, 3), -1.0])
    return (rng.normal(size=(count, 3)) * [1.0, 0.5, 0.3] + at).astype(np.float32)
