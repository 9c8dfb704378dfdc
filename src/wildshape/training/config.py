# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An experiment is a value: frozen dataclasses, saved with every result."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from wildshape.method.multiview import LossConfig
from wildshape.method.network import NetworkConfig
from wildshape.training.batches.views import ViewConfig
from wildshape.training.self_training.pseudo_labels import SelfTrainingConfig


@dataclass(frozen=True)
class OptimConfig:
    """Adam and its schedule; the defaults are the paper's for LiDAR (METHOD 6).

    Attributes:
        steps: gradient steps.
        lr: learning rate at the first step.
        decay: factor of the learning rate every `decay_every` steps.
        decay_every: see `decay`; 0 falls along a half cosine to the share `end` of `lr` instead.
        end: see `decay_every`.
        warmup: steps over which the learning rate rises from zero.
        average: decay of the running mean of the weights that is kept; 0 keeps the last.
        clip: largest norm of the gradient; 0 is none.
        precision: of the encoder's matrix products when training on a GPU, `bf16` or `fp32`; all
            else is float32.
        search: the type in which the encoder's winning points are searched for when training on a
            CPU; bf16 only where the processor multiplies in it (`method/encoders/pcn_winners.py`).
    """

    steps: int = 400_000
    lr: float = 1e-4
    decay: float = 0.7
    decay_every: int = 100_000
    end: float = 0.01
    warmup: int = 0
    average: float = 0.0
    clip: float = 0.0
    precision: Literal["bf16", "fp32"] = "bf16"
    search: Literal["bf16", "fp32"] = "fp32"


@dataclass(frozen=True)
class ValidationConfig:
    """What a validation looks at, and for how long.

    Attributes:
        batches: of held-out tracks, from which the label-free figures are; a median needs some
            hundred scans.
        truth_tracks: held-out tracks with truth that are completed and registered.
        truth_scans: of each.
        level_tracks: held-out tracks from whose middle scans it is found which way is up.
    """

    batches: int = 8
    truth_tracks: int = 8
    truth_scans: int = 6
    level_tracks: int = 128


@dataclass(frozen=True)
class Recipe:
    """Everything that decides a training run except its data and its seed.

    Attributes:
        name: of the preset it comes from.
        self_training: what a teacher's words become; and how headings are agreed on in any run.
        validate_every: steps between validations and checkpoints; on a GPU ten times as many.
        held_out: one track in so many is validated on and not fitted; none if there are fewer.
    """

    name: str
    network: NetworkConfig = field(default_factory=NetworkConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    views: ViewConfig = field(default_factory=ViewConfig)
    optim: OptimConfig = field(default_factory=OptimConfig)
    self_training: SelfTrainingConfig = field(default_factory=SelfTrainingConfig)
    validate_every: int = 1000
    validation: ValidationConfig = field(default_factory=ValidationConfig)
    held_out: int = 20


def stretched(config: OptimConfig, steps: int) -> OptimConfig:
    """The same schedule over another number of steps, all but the warm-up."""
    every = config.decay_every
    if every:
        every = max(1, every * steps // config.steps)
    return replace(config, steps=steps, decay_every=every)


def learning_rate(step: int, config: OptimConfig) -> float:
    """Learning rate of a step, counted from 0."""
    rise = min(1.0, (step + 1) / config.warmup) if config.warmup else 1.0
    if config.decay_every:
        return rise * config.lr * config.decay ** (step // config.decay_every)
    fall = (1 + math.cos(math.pi * min(1.0, step / config.steps))) / 2
    return rise * config.lr * (config.end + (1 - config.end) * fall)
