# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Single scans, each with the pose and the shape that its whole track gave it.

The trainer's reader for self-training (`training/fusing.py` makes the targets) and for the oracle.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.datasets.views import ViewSampler


class FusedTargets(NamedTuple):
    """What every scan of a training set is to give.

    Attributes:
        rotation: `R_sensor_canonical` of every scan of the store, as recorded; zero if unused.
        translation: of the same, metres.
        shapes: points of each used track's object, canonical frame, metres.
        sensors: places from which each used track was seen, canonical frame, metres.
        complete: whether the shapes are whole; else only what the sensors saw is known.
    """

    rotation: Float[Tensor, "S 3 3"]
    translation: Float[Tensor, "S 3"]
    shapes: Float[Tensor, "T G 3"]
    sensors: Float[Tensor, "T O 3"]
    complete: bool = False


class FusedBatch(NamedTuple):
    """Centred scans, each of another track, and their targets.

    Attributes:
        scans: B clouds of n points, metres, about their own centres.
        rotation: `R_scan_canonical`, in the scan's turned and centred frame.
        translation: of the same, metres.
        shapes: target shapes, canonical frame.
        sensors: places from which the track was seen, canonical frame.
    """

    scans: Float[Tensor, "B N 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    shapes: Float[Tensor, "B G 3"]
    sensors: Float[Tensor, "B O 3"]

    def to(self, device: torch.device | str) -> "FusedBatch":
        """The same batch on a device."""
        return FusedBatch(*(part.to(device, non_blocking=True) for part in self))


class FusedSampler:
    """Draws batches of single scans; a batch depends on its seeds alone."""

    def __init__(self, views: ViewSampler, targets: FusedTargets) -> None:
        self.views, self.targets = views, targets

    def draw(self, *seed: int) -> FusedBatch:
        """The batch of these seeds: as many scans as a batch of views has."""
        rng = np.random.default_rng(seed)
        config = self.views.config
        scans_of = self.views.scans_of
        tracks = rng.integers(len(scans_of), size=config.tracks * config.views)
        rows = np.asarray([rng.choice(scans_of[track]) for track in tracks])
        scans, centres, turn = self.views.turned(rows, rng)
        at = torch.from_numpy(rows)
        rotation = turn @ self.targets.rotation[at]
        translation = (turn @ self.targets.translation[at][..., None])[..., 0] - centres
        chosen = torch.from_numpy(tracks)
        shapes, sensors = self.targets.shapes[chosen], self.targets.sensors[chosen]
        return FusedBatch(scans, rotation, translation, shapes, sensors)
