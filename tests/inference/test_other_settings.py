# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Inside a program of somebody else: its settings of torch stay as they were."""

import torch

from wildshape.inference.predictor import load


def test_loading_draws_no_random_numbers():
    before = torch.get_rng_state()
    load()
    assert torch.equal(torch.get_rng_state(), before)
