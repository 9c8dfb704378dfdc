# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One gradient step that never waits for the device: the same on a CPU, a GPU and in a CUDA graph.

What differs from step to step is written beforehand into a few scalars on the device (`Dials`);
what a step gives is read afterwards, now and then (`Meter`). In between nothing is read back, no
shape depends on a value, and no tensor is made of the host's numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.training.batches.host import HostViews
from wildshape.training.batches.resident import ResidentViews
from wildshape.training.config import Recipe, learning_rate
from wildshape.training.objectives import Objective
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.state import TrainState

Views = HostViews | ResidentViews


@dataclass(frozen=True)
class Dials:
    """A step's settings, scalars on the device.

    Attributes:
        rate: learning rate, the very tensor that the optimiser reads.
        fresh: share of the new weights in their running mean.
    """

    step: Tensor
    rate: Tensor
    fresh: Tensor

    @classmethod
    def of(cls, optimiser: torch.optim.Optimizer) -> "Dials":
        """Dials where the optimiser's learning rate lies."""
        rate = optimiser.param_groups[0]["lr"]
        step = torch.zeros((), dtype=torch.int64, device=rate.device)
        return cls(step, rate, torch.zeros_like(rate))

    def turn(self, step: int, recipe: Recipe) -> None:
        """Set them for a step; the host does not wait."""
        optim = recipe.optim
        keep = min(optim.average, (1 + step) / (10 + step))  # the mean is young at first
        self.step.fill_(step)
        self.rate.fill_(learning_rate(step, optim))
        self.fresh.fill_(1 - keep)


class Step:
    """A gradient step; the batch depends on (seed, step, process) alone.

    Args:
        state: is moved on, but for its count of steps.
        objective: of a batch.
        views: give the batches.
        meter: takes the figures.
        clip: largest norm of the gradient; 0 is none.
    """

    def __init__(
        self, state: TrainState, objective: nn.Module, views: Views, meter: Meter, clip: float
    ) -> None:
        self.state, self.objective, self.views = state, objective, views
        self.meter, self.clip = meter, clip
        self.dials = Dials.of(state.optimiser)

    def prepare(self, step: int, recipe: Recipe) -> None:
        """The host's part: turn the dials, lay out the batch."""
        self.dials.turn(step, recipe)
        with record_function("wildshape: sampling"):
            self.views.prepare(step)

    def advance(self) -> None:
        """The device's part."""
        with record_function("wildshape: sampling"):
            batch = self.views.batch(self.dials.step)
        with record_function("wildshape: forward"):
            result: Objective = self.objective(batch)
        self.views.ahead()  # what follows leaves a core free
        with record_function("wildshape: backward"):
            self.state.optimiser.zero_grad(set_to_none=True)
            result.loss.backward()
        with record_function("wildshape: optimiser"):
            if self.clip > 0:
                nn.utils.clip_grad_norm_(self.state.network.parameters(), self.clip)
            self.state.optimiser.step()
            average_for(self.dials.fresh.device)(
                list(self.state.mean.parameters()),
                list(self.state.network.parameters()),
                self.dials.fresh,
            )
        self.meter.write(self.dials.step, result)


Average = Callable[[list[Tensor], list[Tensor], Tensor], None]


def average_for(device: torch.device) -> Average:
    """The faster form: one pass a tensor on a CPU, few launches on a GPU."""
    return average_one_by_one if device.type == "cpu" else average_together


@torch.no_grad()
def average_one_by_one(mean: list[Tensor], now: list[Tensor], fresh: Tensor) -> None:
    """Move a running mean a share of the way to the present weights."""
    for held, new in zip(mean, now):
        held.lerp_(new, fresh)


@torch.no_grad()
def average_together(mean: list[Tensor], now: list[Tensor], fresh: Tensor) -> None:
    """The same of all tensors at once; `_foreach_lerp_` would read its share on the host."""
    way = torch._foreach_sub(now, mean)  # pyright: ignore[reportPrivateImportUsage]
    torch._foreach_mul_(way, fresh)  # pyright: ignore[reportPrivateImportUsage]
    torch._foreach_add_(mean, way)  # pyright: ignore[reportPrivateImportUsage]
