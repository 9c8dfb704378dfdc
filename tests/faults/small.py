# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The command line with everything small: `-m tests.faults.small COMMAND ...`.

A conversion has several parts, a training run several saved states, each within a second.
"""

import sys
from dataclasses import replace

from tests.training.worker import SMALLEST

from wildshape.cli.main import main
from wildshape.datasets.tracks import parts as groups
from wildshape.training import recipes

STEPS, SAVED_EVERY = 45, 20


def shrink() -> None:
    """Two tracks a part; a tiny network, saved often."""
    optim = replace(SMALLEST.optim, steps=STEPS)
    small = replace(SMALLEST, name="tiny", optim=optim, validate_every=SAVED_EVERY)
    recipes.PRESETS["tiny"] = lambda: small
    groups._LEAST = 2


if __name__ == "__main__":
    shrink()
    main(sys.argv[1:])
