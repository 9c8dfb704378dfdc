# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch
from tests import naive
from tests.strategies import clouds

from wildshape.method.encoders.pcn import PCNEncoder


def test_the_join_written_as_a_sum_is_the_join():
    torch.manual_seed(0)
    net, points = PCNEncoder((16, 24, 32, 48)).double(), clouds(1, 3, 50, 3)
    torch.testing.assert_close(net(points), naive.encode(net, points), atol=1e-12, rtol=0)
