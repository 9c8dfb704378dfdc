# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder of the GPU is the dense encoder, in value and in every gradient."""

import pytest
import torch
from tests import naive
from tests.strategies import clouds

from wildshape.method.encoders.pcn import PCNEncoder
from wildshape.method.encoders.pcn_static import LinearMax, encode_static


def encoder(seed=0):
    torch.manual_seed(seed)
    return PCNEncoder((16, 24, 32, 48)).double()


def value_and_gradients(encode, net, points):
    net.zero_grad()
    code = encode(points)
    (code * clouds(99, *code.shape).to(code)).sum().backward()
    return code.detach(), {name: p.grad.clone() for name, p in net.named_parameters()}


def assert_same(net, points, twin, tolerance=1e-12, inner=torch.float64):
    code, gradients = value_and_gradients(lambda x: encode_static(net, x, inner), net, points)
    expected, slow = value_and_gradients(twin, net, points)
    size = float(expected.abs().max())
    torch.testing.assert_close(code, expected, atol=tolerance * size, rtol=0)
    for name in slow:
        apart = float((gradients[name] - slow[name]).norm() / slow[name].norm())
        assert apart < tolerance, name


@pytest.mark.parametrize("count", [1, 2, 63, 200])
@pytest.mark.parametrize("batch", [1, 5])
def test_same_code_and_gradients(count, batch):
    net, points = encoder(count), clouds(batch, batch, count, 3)
    assert_same(net, points, net)
    assert_same(net, points, lambda x: naive.encode(net, x))


def test_repeated_points():
    """Scans are resampled with replacement: the dense maximum shares its gradient among copies."""
    net, points = encoder(1), clouds(7, 3, 20, 3)
    pick = torch.randint(20, (90,), generator=torch.Generator().manual_seed(0))
    assert_same(net, points[:, pick], net)
    assert_same(net, points[:, :1].expand(-1, 30, -1), net)


def test_the_linear_maximum_by_differences():
    u, weight = clouds(1, 2, 6, 4).requires_grad_(), clouds(2, 5, 4).requires_grad_()
    assert torch.autograd.gradcheck(LinearMax.apply, (u, weight))


def test_bfloat16_inside_is_near_and_its_weights_stay_float32():
    """8 bits of mantissa: a code off by a few thousandths, gradients by as many hundredths."""
    net, points = encoder(4).float(), clouds(10, 4, 300, 3).float()
    code, gradients = value_and_gradients(
        lambda x: encode_static(net, x, torch.bfloat16), net, points
    )
    expected, exact = value_and_gradients(net, net, points)
    assert code.dtype == torch.float32
    assert float((code - expected).norm() / expected.norm()) < 0.01
    for name, gradient in gradients.items():
        assert gradient.dtype == torch.float32
        cosine = torch.cosine_similarity(gradient.flatten(), exact[name].flatten(), dim=0)
        assert float(cosine) > 0.9, name


def test_weights_that_are_not_finite_give_a_code_that_is_not():
    net = encoder(5)
    with torch.no_grad():
        net.point1.bias.fill_(torch.nan)
    assert encode_static(net, clouds(11, 2, 20, 3), torch.float64).isnan().all()
