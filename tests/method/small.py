# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The smallest network, and the settings that are saved with it."""

from wildshape.geometry.projection.visibility import FacingBins
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.network import NetworkConfig

SMALL = NetworkConfig(encoder=(8, 8, 16, 16), decoder=(16, 16), pose=(8, 8), points=32, scale=2.0)


def settings(projection=FacingBins(0.3)):  # noqa: B008
    return ModelSettings(
        network=SMALL,
        sensor="lidar",
        input_points=128,
        projection=projection,
        beta=0.05,
        extent_m=(0.5, 7.25),
        cost_m=(0.08, 0.21),
        provenance={"command": "wildshape train", "seed": 3},
        metrics={"cycle_deg": 4.5},
    )
