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
        self._first: tuple[int, float] | None = None

    def adjust(self, run: Run) -> bool:
        """Look at the clock, every so many steps; whether the number of steps was changed."""
        step, now = run.state.step, time.monotonic()
        if self._first is None:  # the first steps are slow: memory is being touched
            self._first = (step, now)
        left = self.seconds - (now - self.began)
        if self.planned == 0 and step < _MEASURED_STEPS and left > self.seconds / 2:
            return False
        steps = step + max(1, round(left * self._rate(step, now)))
        if self.planned and not self._worth_a_change(run, steps):
            return False
        validate_every = run.recipe.validate_every if self.planned else steps // _VALIDATIONS
        self.planned = steps
        _plan(run, steps, max(1, validate_every))
        return True

    def _rate(self, step: int, now: float) -> float:
        """Steps a second since the first look."""
        first_step, first = self._first or (0, self.began)
        if step == first_step:
            return step / max(1e-9, now - self.began)
        return (step - first_step) / max(1e-9, now - first)

    def _worth_a_change(self, run: Run, steps: int) -> bool:
        """Whether the new number is another, and jumps no share of the run still to come."""
        step = run.state.step
        if step >= self.planned:
            return False
        jumps = any(
            (int(share * self.planned) >= step) != (int(share * steps) >= step)
            for share in run.recipe.loss.agree_at
        )
        drift = max(_DRIFT * (self.planned - step), _MEASURED_STEPS)
        return not jumps and abs(steps - self.planned) > drift


def _plan(run: Run, steps: int, validate_every: int) -> None:
    optim = replace(run.recipe.optim, steps=steps)
    run.recipe = replace(run.recipe, optim=optim, validate_every=validate_every)
    run.provenance["recipe"] = asdict(run.recipe)
