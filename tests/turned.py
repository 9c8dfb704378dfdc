# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The example's scan as sensors would see it that are held at random."""

from pathlib import Path

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.geometry.transforms.se3 import SE3

SCAN = Path(__file__).parents[1] / "examples" / "scan.npy"


def turned_scans(count: int) -> list[np.ndarray]:
    points = np.load(SCAN)
    turns = random_rotation(count, torch.Generator().manual_seed(0)).double()
    still = torch.zeros(3, dtype=torch.float64)
    return [SE3(turn, still).apply_numpy(points) for turn in turns]
