# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures that Gu et al. (ECCV 2020) print, to stand beside ours (METHOD 10).

Measured on other data: a ratio may be looked at, the same benchmark is never claimed.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperRow:
    """One printed row; metres, degrees, `acc30` as a share; None where the paper prints none."""

    data: str
    method: str
    cd: float | None = None
    precision: float | None = None
    coverage: float | None = None
    acc30: float | None = None
    rot_median_deg: float | None = None
    trans_median_m: float | None = None


VEHICLE, KITTI = "3D vehicle", "SemanticKITTI"
_VIEWS = "ShapeNet {}, CD x 100"
PLANE, CAR, CHAIR = (_VIEWS.format(name) for name in ("airplane", "car", "chair"))

LIDAR_ROWS = (
    PaperRow(VEHICLE, "paper, best of 5 seeds", 0.255, 0.083, 0.172, 0.9768, 2.37, 0.13),
    PaperRow(VEHICLE, "paper, mean of 5 seeds", 0.26, None, None, 0.7654, 4.21, 0.16),
    PaperRow(VEHICLE, "oracle", 0.140, 0.064, 0.077),
    PaperRow(VEHICLE, "Local-ICP", 0.315, 0.170, 0.145, 0.8409, 11.33, 0.30),
    PaperRow(VEHICLE, "Global-ICP", 0.309, 0.174, 0.135, 0.8383, 10.69, 0.26),
    PaperRow(VEHICLE, "DPC-LIDAR", 0.928, 0.489, 0.439),
    PaperRow(KITTI, "paper, best of 5 seeds", 0.194, 0.087, 0.107, 0.8937, 2.86, 0.17),
    PaperRow(KITTI, "paper, mean of 5 seeds", 0.20, None, None, 0.6062, 11.54, 0.21),
    PaperRow(KITTI, "Local-ICP", 0.246, 0.152, 0.094, 0.8529, 13.04, 0.31),
    PaperRow(KITTI, "Global-ICP", 0.213, 0.138, 0.075, 0.8528, 10.59, 0.23),
)

# The car's pose accuracy needs the losses on 2D projections; the plain method has 0.4958.
VIEW_ROWS = (
    PaperRow(PLANE, "paper", 1.95, 0.91, 1.05, 0.9287, 1.87, 0.01),
    PaperRow(CAR, "paper", 2.68, 1.27, 1.41, 0.9103, 2.46),
    PaperRow(CHAIR, "paper", 3.33, 1.69, 1.64, 0.9582, 2.31, 0.02),
    PaperRow(PLANE, "oracle", 1.65, 0.77, 0.88),
    PaperRow(CAR, "oracle", 2.04, 1.01, 1.03),
    PaperRow(CHAIR, "oracle", 2.82, 1.47, 1.35),
    PaperRow(PLANE, "DPC", 6.26, acc30=0.7417),
    PaperRow(CAR, "DPC", 3.54, acc30=0.8475),
    PaperRow(CHAIR, "DPC", 4.85, acc30=0.8002),
    PaperRow(PLANE, "DPC-dagger", 13.17, acc30=0.5564),
    PaperRow(CAR, "DPC-dagger", 4.73, acc30=0.8217),
    PaperRow(CHAIR, "DPC-dagger", 7.32, acc30=0.7045),
)
