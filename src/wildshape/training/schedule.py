# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Weights and rates as functions of the step."""

import math

from wildshape.losses.multiview import LossConfig
from wildshape.training.config import OptimConfig

_LAST = 0.01


def learning_rate(step: int, config: OptimConfig) -> float:
    """Learning rate of a step, counted from 0."""
    rise = min(1.0, (step + 1) / config.warmup) if config.warmup else 1.0
    if config.decay_every:
        return rise * config.lr * config.decay ** (step // config.decay_every)
    fall = (1 + math.cos(math.pi * min(1.0, step / config.steps))) / 2
    return rise * config.lr * (_LAST + (1 - _LAST) * fall)


def template_weight(step: int, steps: int, config: LossConfig) -> float:
    """Weight of the template pull: geometric from `template` to `template_end`."""
    if config.template <= 0 or config.template_end <= 0:
        return config.template
    share = min(1.0, step / max(1, steps - 1))
    return config.template * (config.template_end / config.template) ** share
