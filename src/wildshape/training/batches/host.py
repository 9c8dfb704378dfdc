# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Batches drawn on the host and laid where the step looks for them."""

from concurrent.futures import Future

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.threads import alone
from wildshape.training.batches.fused import FusedBatch, FusedSampler
from wildshape.training.batches.views import Batch, ViewSampler


class HostViews:
    """A sampler for a training step: on a GPU its batches are copied to fixed tensors.

    The copies come from pinned memory and wait for nothing; their tensors stay the same from step
    to step, so that a recorded step finds each batch at its place.

    Args:
        sampler: draws; a batch depends on (seed, step, process) alone.
        seed: of the run.
        process: number of the process.
        device: where the step runs.
    """

    def __init__(
        self, sampler: ViewSampler | FusedSampler, seed: int, process: int, device: torch.device
    ) -> None:
        self.sampler, self.seed, self.process, self.device = sampler, seed, process, device
        self._held: Batch | FusedBatch | None = None
        self._thread = alone(1)
        self._ahead: tuple[int, Future[Batch | FusedBatch]] | None = None

    def prepare(self, step: int) -> None:
        """Lay out the step's batch."""
        if self._ahead is None or self._ahead[0] != step:
            self._draw(step)
        assert self._ahead is not None
        batch = self._ahead[1].result()
        if self.device.type == "cpu":
            self._held = batch
        elif self._held is None:
            self._held = batch.to(self.device)
        else:
            for held, part in zip(self._held, batch):
                held.copy_(part.pin_memory(), non_blocking=True)

    def ahead(self) -> None:
        """Have a thread draw the batch of the next step."""
        if self._ahead is not None:
            self._draw(self._ahead[0] + 1)

    def batch(self, step: Int64[Tensor, ""]) -> Batch | FusedBatch:  # noqa: ARG002
        """What `prepare` drew."""
        assert self._held is not None
        return self._held

    def hold(self, anchors: Float[Tensor, "S 3 3"]) -> None:
        """From now on scans are held to these headings."""
        if isinstance(self.sampler, ViewSampler):
            self.sampler.anchors = anchors
            self._ahead = None  # drawn without them

    def _draw(self, step: int) -> None:
        """Have the batch of a step drawn."""
        drawn = self._thread.submit(self.sampler.draw, self.seed, step, self.process)
        self._ahead = step, drawn
