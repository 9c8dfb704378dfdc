# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When a step runs as it is, is recorded, is replayed; with stand-ins for the graph."""

import pytest

from wildshape.training.runtime import cuda_graph as capture
from wildshape.training.runtime.cuda_graph import Captured


class Tape:
    """Stands for a CUDA graph: recording does nothing, replaying does the step."""

    def __init__(self, step):
        self.step = step

    def replay(self):
        self.step()


@pytest.fixture
def told(monkeypatch):
    """What was done, in order."""
    happened = []

    def warm(step):
        happened.append("warm")
        step()

    def record(step):
        happened.append("record")
        return Tape(step)

    monkeypatch.setattr(capture, "warm", warm)
    monkeypatch.setattr(capture, "record", record)
    return happened


def test_a_few_steps_as_they_are_then_recorded_once_and_replayed(told):
    steps, said = [], []
    captured = Captured(lambda: steps.append(None), said.append)
    for done in range(1, 7):
        captured()
        assert len(steps) == done
    assert told == ["warm", "warm", "warm", "record"]
    assert not said


def test_what_cannot_be_recorded_runs_as_it_is_and_says_so_once(told, monkeypatch):
    def refuse(step):
        told.append("record")
        raise RuntimeError("operation not permitted when stream is capturing\nand more")

    monkeypatch.setattr(capture, "record", refuse)
    steps, said = [], []
    captured = Captured(lambda: steps.append(None), said.append)
    for done in range(1, 9):
        captured()
        assert len(steps) == done
    assert told.count("record") == 1
    assert len(said) == 1
    assert "(operation not permitted when stream is capturing): it runs slower" in said[0]
