# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from wildshape.training.config import OptimConfig, learning_rate


def test_warmup_rises_linearly_to_the_full_rate():
    config = OptimConfig(steps=1000, lr=2.0, decay_every=10_000, warmup=4)
    rates = [learning_rate(step, config) for step in range(6)]
    assert rates == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.0, 2.0])


def test_cosine_falls_to_a_hundredth():
    config = OptimConfig(steps=100, lr=1.0, decay_every=0)
    assert learning_rate(0, config) == pytest.approx(1.0)
    assert learning_rate(50, config) == pytest.approx(0.505)
    assert learning_rate(25, config) == pytest.approx(0.01 + 0.99 * (1 + math.cos(math.pi / 4)) / 2)
    assert learning_rate(100, config) == pytest.approx(0.01)
    rates = [learning_rate(step, config) for step in range(101)]
    assert rates == sorted(rates, reverse=True)
