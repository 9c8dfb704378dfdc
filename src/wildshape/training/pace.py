# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training for a given time: the number of steps follows from the speed found on the way."""

import time
from dataclasses import asdict, replace

from wildshape.training.loop import Run

_MEASURED_STEPS, _VALIDATIONS, _DRIFT = 50, 8, 0.1


class Pace:
    """Chooses a run's number of steps so that it ends after so many seconds.

    The learning rate falls to its end at the last step, so it is chosen early and changed only if
    the machine's speed changes by more than a tenth.

    Attributes:
        planned: steps; 0 until the speed is known.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.planned = seconds, 0
        self.began = time.monotonic()
        self._last = (0, self.began)

    def adjust(self, run: Run) -> bool:
        """Look at the clock; whether the number of steps was changed."""
        step, now = run.state.step, time.monotonic()
        left = self.seconds - (now - self.began)
        first = self.planned == 0
        if first and step < _MEASURED_STEPS and left > self.seconds / 2:
            return False
        if not first and step >= self.planned:
            return False
        rate = (step - self._last[0]) / max(1e-9, now - self._last[1])
        self._last = (step, now)
        steps = step + max(1, round(left * rate))
        drift = max(_DRIFT * (self.planned - step), _MEASURED_STEPS)
        if not first and abs(steps - self.planned) <= drift:
            return False
        self.planned = steps
        _plan(run, steps, max(1, steps // _VALIDATIONS) if first else run.recipe.validate_every)
        return True


def _plan(run: Run, steps: int, validate_every: int) -> None:
    optim = replace(run.recipe.optim, steps=steps)
    run.recipe = replace(run.recipe, optim=optim, validate_every=validate_every)
    run.provenance["recipe"] = asdict(run.recipe)
