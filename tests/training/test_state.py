# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Units that die leave nothing in the optimiser that slows a CPU down; states are saved in time."""

import copy

import torch
from torch import nn

from wildshape.training import loop as loops
from wildshape.training.loop import Loop, run_to_end
from wildshape.training.objectives import Objective
from wildshape.training.runtime.log import RunLog
from wildshape.training.runtime.running_mean import Meter
from wildshape.training.state import TrainState

STEPS, DIES_AT = 1200, 10
SMALLEST_NORMAL = torch.finfo(torch.float32).tiny


def trained(folder):
    """By the loop of all trainings: every other row gets gradients of zero after some steps."""
    network = nn.Linear(8, 8)
    nn.init.constant_(network.weight, 0.5)
    nn.init.zeros_(network.bias)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    state = TrainState(network, copy.deepcopy(network), optimiser)

    def take():
        for number, weight in enumerate(network.parameters()):
            weight.grad = torch.cos(weight.detach() + number)
            if state.step >= DIES_AT:
                weight.grad[::2] = 0.0
        optimiser.step()
        meter.write(torch.tensor(state.step), Objective(torch.zeros(()), {}, torch.zeros(1).long()))
        state.step += 1

    meter = Meter(1, 0, torch.device("cpu"))
    loop = Loop(state, lambda: (STEPS, STEPS), STEPS, take, dict, dict)
    with RunLog(folder, 0) as log:
        run_to_end(loop, meter, log, None, lambda: False)
    return state


def denormal(state):
    """How many of the moments are neither zero nor numbers of full precision."""
    moments = [held[name] for held in state.optimiser.state.values() for name in held]
    return sum(int(((m != 0) & (m.abs() < SMALLEST_NORMAL)).sum()) for m in moments)


def test_moments_of_dead_units_end_at_zero_and_weights_are_the_same(tmp_path, monkeypatch):
    found = trained(tmp_path)
    monkeypatch.setattr(TrainState, "drop_faded", lambda state: None)
    plain = trained(tmp_path)
    assert denormal(plain) >= 36  # torch's own: they round to themselves
    assert denormal(found) == 0
    for one, other in zip(found.network.parameters(), plain.network.parameters()):
        assert torch.equal(one, other)


def test_a_killed_run_loses_some_minutes_however_rarely_it_is_validated(tmp_path, monkeypatch):
    network = nn.Linear(1, 1)
    state = TrainState(network, network, torch.optim.Adam(network.parameters()))
    meter, saved = Meter(1, 0, torch.device("cpu")), []

    def take():
        meter.write(torch.tensor(state.step), Objective(torch.zeros(()), {}, torch.zeros(1).long()))
        state.step += 1

    def keep():
        saved.append(state.step)
        return {}

    # A step takes a minute: the state is saved every five of them, at the next line of the log.
    monkeypatch.setattr(loops, "monotonic", lambda: 60.0 * state.step)
    with RunLog(tmp_path, 0) as log:
        run_to_end(Loop(state, lambda: (24, 12), 2, take, keep, keep), meter, log, None, bool)
    assert saved == [6, 12, 18, 24]
