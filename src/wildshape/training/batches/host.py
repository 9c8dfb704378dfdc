# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Batches drawn on the host and laid where the step looks for them."""

from collections.abc import Iterator
from concurrent.futures import Future
from functools import partial
from itertools import count

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.threads import alone
from wildshape.parallel.processes import Processes
from wildshape.training.batches.fused import FusedBatch, FusedSampler
from wildshape.training.batches.views import Batch, ViewSampler

_Sampler = ViewSampler | FusedSampler
_Batch = Batch | FusedBatch


class HostViews:
    """A sampler for a training step: on a GPU its batches are copied to fixed tensors.

    The copies come from pinned memory and wait for nothing; their tensors stay the same from step
    to step, so that a recorded step finds each batch at its place.

    Args:
        sampler: draws; a batch depends on (seed, step, process) alone.
        seed: of the run.
        process: number of the process.
        device: where the step runs.
        workers: processes that draw, many steps ahead, where a step takes less time than its batch;
            1: a thread of this one draws the next step's.
    """

    def __init__(
        self,
        sampler: _Sampler,
        seed: int,
        process: int,
        device: torch.device,
        workers: int = 1,
    ) -> None:
        self.sampler, self.device = sampler, device
        self._held: _Batch | None = None
        draw = partial(_draw, sampler, seed, process)
        self._drawn = _ByProcesses(draw, workers) if workers > 1 else _ByThread(draw)

    def prepare(self, step: int) -> None:
        """Lay out the step's batch."""
        batch = self._drawn.take(step)
        if self.device.type == "cpu":
            self._held = batch
        elif self._held is None:
            self._held = batch.to(self.device)
        else:
            for held, part in zip(self._held, batch):
                held.copy_(part.pin_memory(), non_blocking=True)

    def ahead(self) -> None:
        """Have the next step's batch drawn meanwhile."""
        self._drawn.ahead()

    def batch(self, step: Int64[Tensor, ""]) -> _Batch:  # noqa: ARG002
        """What `prepare` drew."""
        assert self._held is not None
        return self._held

    def hold(self, anchors: Float[Tensor, "S 3 3"]) -> None:
        """From now on scans are held to these headings."""
        if isinstance(self.sampler, ViewSampler):
            self.sampler.anchors = anchors
            self._drawn.close()  # what was drawn was drawn without them

    def close(self) -> None:
        """End whoever draws; a later step has others begin."""
        self._drawn.close()


def _draw(sampler: _Sampler, seed: int, process: int, step: int) -> _Batch:
    return sampler.draw(seed, step, process)


_Draw = partial[_Batch]


class _ByThread:
    """A thread draws the batch of the next step."""

    def __init__(self, draw: _Draw) -> None:
        self._draw = draw
        self._thread = alone(1)
        self._ahead: tuple[int, Future[_Batch]] | None = None

    def take(self, step: int) -> _Batch:
        """The batch of a step."""
        if self._ahead is None or self._ahead[0] != step:
            self._ahead = step, self._thread.submit(self._draw, step)
        return self._ahead[1].result()

    def ahead(self) -> None:
        """Begin with the batch after the last taken."""
        if self._ahead is not None:
            step = self._ahead[0] + 1
            self._ahead = step, self._thread.submit(self._draw, step)

    def close(self) -> None:
        """Forget what is drawn, and end the thread."""
        self._ahead = None
        self._thread.shutdown()
        self._thread = alone(1)


class _ByProcesses:
    """Processes draw the batches of many steps ahead."""

    def __init__(self, draw: _Draw, workers: int) -> None:
        self._draw, self._workers = draw, workers
        self._team: Processes | None = None
        self._stream: Iterator[_Batch] | None = None
        self._next = 0

    def take(self, step: int) -> _Batch:
        """The batch of a step."""
        if self._stream is None or self._next != step:
            self._team = self._team or Processes(self._workers)
            self._stream = self._team.in_order(self._draw, count(step))
        self._next = step + 1
        return next(self._stream)

    def ahead(self) -> None:
        """They are ahead."""

    def close(self) -> None:
        """Forget what is drawn, and end the processes."""
        self._stream = None
        if self._team is not None:
            self._team.close()
            self._team = None
