# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Completed objects of a drive, as the stages after completion get them."""

import numpy as np
import torch

from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3


def still(count, breaks=()):
    """The turns of a sensor that does not move."""
    poses = SE3(torch.eye(3).double().expand(count, 3, 3), torch.zeros(count, 3).double())
    return Turns(tuple(range(count)), poses, breaks=breaks)


def completed(boxes, frames=None, name="a", size=(4.0, 1.8, 1.5), cost=0.1, parts=(), phases=()):
    """An object seen from the first of its completed scans to the last."""
    frames = tuple(range(len(boxes))) if frames is None else frames
    met = np.array(phases or [0.0] * len(frames))
    whole = tuple(range(frames[0], frames[-1] + 1))
    sightings = Sightings(name, whole, ((0,),) * len(whole), (200,) * len(whole), parts)
    return Completed(sightings, frames, np.array(boxes, float), size, cost, 0.5, phases=met)
