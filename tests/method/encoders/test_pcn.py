# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import torch
from tests import naive
from tests.strategies import clouds

from wildshape.method.encoders.pcn import PCNEncoder


def encoder(seed=0):
    torch.manual_seed(seed)
    return PCNEncoder((16, 24, 32, 48)).double()


def test_the_join_written_as_a_sum_is_the_join():
    net, points = encoder(), clouds(1, 3, 50, 3)
    torch.testing.assert_close(net(points), naive.encode(net, points), atol=1e-12, rtol=0)


def test_order_and_repetition_of_points_do_not_matter():
    net, points = encoder(), clouds(2, 2, 40, 3)
    code = net(points)
    order = torch.randperm(40, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(net(points[:, order]), code, atol=1e-12, rtol=0)
    repeated = torch.cat((points, points[:, :17], points[:, 3:4].expand(-1, 9, -1)), dim=1)
    torch.testing.assert_close(net(repeated), code, atol=1e-12, rtol=0)


def test_each_cloud_is_coded_on_its_own():
    net, points = encoder(), clouds(3, 4, 30, 3)
    alone = torch.cat([net(cloud[None]) for cloud in points])
    torch.testing.assert_close(net(points), alone, atol=1e-12, rtol=0)


def test_a_new_point_matters():
    net, points = encoder(), clouds(4, 1, 30, 3)
    far = torch.cat((points, torch.full((1, 1, 3), 9.0, dtype=torch.float64)), dim=1)
    assert not torch.allclose(net(points), net(far))
