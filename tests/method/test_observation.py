# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch

from wildshape.method.observation import masked_mean


def test_mean_over_nothing_is_zero_and_has_a_gradient():
    values = torch.ones(1, 3, requires_grad=True)
    masked_mean(values, torch.zeros(1, 3, dtype=torch.bool)).sum().backward()
    assert values.grad is not None
    assert torch.equal(values.grad, torch.zeros(1, 3))
