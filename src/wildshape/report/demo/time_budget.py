# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Training for a given time: the number of steps follows from the speed found on the way."""

import time
from collections import deque
from dataclasses import asdict, replace
from statistics import median

from wildshape.training.loop import Run

_MEASURED_STEPS, _VALIDATIONS = 75, 8
_MORE, _FEWER, _LEAST_DRIFT = 0.3, 0.1, 25  # shares of the steps left, and steps
_RATES = 7  # a median of so many: one that held a validation does not count
_USABLE = 0.9  # share of the time that steps get; the rest are validations and agreements


class TimeBudget:
    """Chooses a run's number of steps so that it ends after so many seconds.

    The learning rate falls to its end at the last step, so it is chosen early and changed only
    where the machine's speed changes much.

    Attributes:
        planned: steps; 0 until the speed is known.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds, self.planned = seconds, 0
        self.began = time.monotonic()
        self._last = (0, self.began)
        self._rates: deque[float] = deque(maxlen=_RATES)

    def adjust(self, run: Run) -> bool:
        """Look at the clock, every so many steps; whether the number of steps was changed."""
        step, now = run.state.step, time.monotonic()
        self._rates.append((step - self._last[0]) / max(1e-9, now - self._last[1]))
        self._last = (step, now)
        left = self.seconds - (now - self.began)
        if self.planned == 0 and step < _MEASURED_STEPS and left > self.seconds / 2:
            return False
        steps = step + max(1, round(_USABLE * left * median(self._rates)))
        if self.planned and not self._worth_a_change(run, steps):
            return False
        validate_every = run.recipe.validate_every if self.planned else steps // _VALIDATIONS
        if not self.planned:
            _agree_later(run, step, steps)
        self.planned = steps
        _plan(run, steps, max(1, validate_every))
        return True

    def _worth_a_change(self, run: Run, steps: int) -> bool:
        """Whether the new number is another, and jumps no share of the run still to come."""
        step = run.state.step
        if step >= self.planned:
            return False
        jumps = any(
            (int(share * self.planned) >= step) != (int(share * steps) >= step)
            for share in run.recipe.loss.agree_at
        )
        more, left = steps - self.planned, self.planned - step
        drift = more > max(_MORE * left, _LEAST_DRIFT) or -more > max(_FEWER * left, _LEAST_DRIFT)
        return drift and not jumps


def _agree_later(run: Run, step: int, steps: int) -> None:
    """Shares at which headings are agreed on, put off where the first of them has passed."""
    shares = run.recipe.loss.agree_at
    late = (step + 0.5) / steps - min(shares, default=1.0)
    if late > 0 and int(min(shares) * steps) < step:
        loss = replace(run.recipe.loss, agree_at=tuple(share + late for share in shares))
        run.recipe = replace(run.recipe, loss=loss)


def _plan(run: Run, steps: int, validate_every: int) -> None:
    optim = replace(run.recipe.optim, steps=steps)
    run.recipe = replace(run.recipe, optim=optim, validate_every=validate_every)
    run.provenance["recipe"] = asdict(run.recipe)
