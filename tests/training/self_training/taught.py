# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A recipe that learns from pseudo-labels, in small."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.training.worker import SMALLEST

from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.posed_parts import PosedParts

NOT_KEPT = PosedParts(Path(), {})  # a file has more tracks than tests
TAUGHT = replace(
    SMALLEST,
    optim=replace(SMALLEST.optim, steps=20),
    views=replace(SMALLEST.views, turn="facing", roll=0.5),
    validate_every=10,
)


def sampler_of(store):
    return ViewSampler(store, np.arange(len(store)), TAUGHT.views)
