# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A step recorded once as a CUDA graph and replayed: one launch instead of some hundreds.

The first steps run as they are, on a stream of their own, so that kernels are compiled, libraries
set up and the optimiser's state made before anything is recorded. They are steps like any others.
"""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch

_WARM_UP = 3


@runtime_checkable
class Graph(Protocol):
    """What can be replayed."""

    def replay(self) -> None:
        """Do again, on the same tensors, what was recorded."""


class Captured:
    """Calls `step`, before long by replaying it.

    Args:
        step: reads and writes the same tensors each time, and never waits for the device.
        say: is told, once, if the step cannot be recorded; it then runs as it is.
    """

    def __init__(self, step: Callable[[], None], say: Callable[[str], None]) -> None:
        self.step, self.say = step, say
        self.graph: Graph | None = None
        self._run = 0

    def __call__(self) -> None:
        """One step."""
        if self.graph is not None:
            self.graph.replay()
            return
        if self._run == _WARM_UP:
            self.graph = self._recorded()
        self._run += 1
        if self.graph is not None:
            self.graph.replay()
        elif self._run <= _WARM_UP:
            warm(self.step)
        else:
            self.step()

    def _recorded(self) -> Graph | None:
        try:
            return record(self.step)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[0]
            self.say(f"the step cannot be recorded as a CUDA graph ({reason}): it runs slower")
            return None


def warm(step: Callable[[], None]) -> None:
    """Run a step on a stream of its own, as recording will."""
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        step()
    torch.cuda.current_stream().wait_stream(stream)


def record(step: Callable[[], None]) -> Graph:
    """Record a step; nothing of it is done yet."""
    graph = torch.cuda.CUDAGraph()
    # The outer context brings the stream back even where the end of a failed recording raises.
    with torch.cuda.stream(torch.cuda.current_stream()), torch.cuda.graph(graph):
        step()
    return graph
