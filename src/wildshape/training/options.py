# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a user says of a training: the options of `wildshape train`."""

from dataclasses import dataclass

from wildshape.arguments import check_fields
from wildshape.errors import BadInputError
from wildshape.io.scans.points import SENSOR_METRES, Coordinates
from wildshape.method.encoders.named import Backbone
from wildshape.training.recipes import recipe_named

_SEEDS = 1 << 64  # torch takes no more


@dataclass(frozen=True)
class TrainingOptions:
    """How a model is trained.

    Attributes:
        preset: of `recipes.PRESETS`; DPC's have a training of their own (`baselines/dpc`).
        encoder: point network that reads a scan; None: the preset's.
        steps: gradient steps instead of the preset's; the schedule is stretched to them, all but
            the warm-up.
        seed: of weights and batches.
        resume: go on with the run; a finished one is left as it is.
        start: fine-tune these weights, a checkpoint of the same preset or `shipped`.
        teacher: a checkpoint or `shipped`, whose pseudo-labels are trained on; `truth` is the
            oracle.
        headings: checkpoint that is asked which way views look that come in no order.
        device: `auto`, `cpu` or `cuda`.
        coordinates: of the data's files.
        overwrite: replace an earlier run.
        profile: write where a step's time goes; the weights are the same.
    """

    preset: str = "default"
    encoder: Backbone | None = None
    steps: int | None = None
    seed: int = 0
    resume: bool = False
    start: str | None = None
    teacher: str | None = None
    headings: str | None = None
    device: str = "auto"
    coordinates: Coordinates = SENSOR_METRES
    overwrite: bool = False
    profile: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.preset.startswith("dpc"):
            recipe_named(self.preset)
        if not 0 <= self.seed < _SEEDS:
            raise BadInputError(f"--seed {self.seed}: expected 0 or more, below 2^64.")
        if self.steps is not None and self.steps < 1:
            raise BadInputError(f"--steps {self.steps}: expected 1 or more.")
        if self.resume and self.overwrite:
            raise BadInputError(
                "--resume goes on with a run, --overwrite replaces it; pass one of them."
            )
        if self.headings and self.teacher in (None, "truth"):
            raise BadInputError(
                "--headings: decides which way a teacher's tracks look; pass --teacher M, too."
            )
