# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the last steps gave, kept on the device; the host waits for it only when it reads."""

import time
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.training.objectives import Objective


class Meter:
    """A ring of the last steps' figures, one row a step: loss, its terms, each branch's share.

    The terms are those of the first step, whatever the objective calls them.

    Args:
        branches: K.
        step: the first step to be written.
        device: of the steps.
    """

    ROWS = 256

    def __init__(self, branches: int, step: int, device: torch.device) -> None:
        self.branches, self.since = branches, step
        self.started = time.perf_counter()
        self.names: tuple[str, ...] = ()
        self.ring = torch.zeros(self.ROWS, 0, device=device)

    def write(self, step: Int64[Tensor, ""], result: Objective) -> None:
        """Part of a step: put its figures into their row."""
        terms = (result.loss.detach(), *result.terms.values())
        branch = torch.arange(self.branches, device=step.device)
        wins = (result.winner[:, None] == branch).float().mean(0)
        row = torch.cat((torch.stack(terms), wins))
        if not self.names:
            self.names = ("loss", *result.terms)
            self.ring = row.new_zeros(self.ROWS, len(row))
        self.ring.index_copy_(0, (step % self.ROWS)[None], row[None])

    def losses(self, first: int, end: int) -> Float[Tensor, "steps"]:
        """The loss of each of these steps, at most the last 256."""
        rows = torch.arange(first, end) % self.ROWS
        return self.ring[rows.to(self.ring.device), 0].cpu()

    def read(self, end: int) -> dict[str, Any]:
        """Means over the steps since the last reading, up to `end`; and start anew.

        Raises:
            BadInputError: the loss is not finite.
        """
        count = end - self.since
        rows = torch.arange(self.since, end) % self.ROWS
        means = self.ring[rows.to(self.ring.device)].mean(0).tolist()
        refuse_not_finite(means[0], end)
        rate = count / (time.perf_counter() - self.started)
        self.started, self.since = time.perf_counter(), end
        return {
            **dict(zip(self.names, means)),
            "branch_shares": [round(share, 4) for share in means[len(self.names) :]],
            "steps_per_second": rate,
        }


def refuse_not_finite(loss: float, step: int) -> None:
    """Stop before anything is spoilt.

    Raises:
        BadInputError: the loss is not finite.
    """
    if not np.isfinite(loss):
        raise BadInputError(
            f"training stopped before step {step}: the loss is not finite; check the data's"
            " units, or begin a new run from the last checkpoint (--start) or of another --seed."
        )
