# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers that decide an adaptation, in a frozen record."""

from dataclasses import dataclass

from wildshape.arguments import check_fields
from wildshape.errors import BadInputError


@dataclass(frozen=True)
class AdaptConfig:
    """How a model is adapted to drives.

    Attributes:
        steps: of the training.
        seed: of batches, and of which tracks are held out.
        lr: learning rate at its highest; it falls along a cosine.
        average: decay of the running mean of the weights that is kept.
        held_out: share of the tracks that are measured on and not trained on.
        fewest_held: of them.
        fewest_trained: of the others.
        scans: of a track, spread evenly.
        fewest_scans: shorter tracks are left out.
        fewest_points: of a scan.
        clear: share of a standing vehicle's scans that must be posed as the whole track, one by
            one; of others the heading is not sure enough to be taught.
        measured: scans of a track held out.
        save_every: steps; so many at most are lost with a killed run.
    """

    steps: int = 300
    seed: int = 0
    lr: float = 1e-4
    average: float = 0.99
    held_out: float = 0.25
    fewest_held: int = 2
    fewest_trained: int = 4
    scans: int = 32
    fewest_scans: int = 4
    fewest_points: int = 100
    clear: float = 0.75
    measured: int = 16
    save_every: int = 50

    def __post_init__(self) -> None:
        check_fields(self)
        if self.steps < 1:
            raise BadInputError(f"--adapt-steps {self.steps}: expected 1 or more.")
