# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The pass through winning points alone is the dense encoder, in value and in every gradient."""

import pytest
import torch
from tests import naive
from tests.strategies import clouds
from torch.utils._python_dispatch import TorchDispatchMode

from wildshape.method.encoders.pcn import PCNEncoder
from wildshape.method.encoders.pcn_winners import distinct_rows, encode_winners
from wildshape.ops.threads import exact_on


def encoder(seed=0):
    torch.manual_seed(seed)
    return PCNEncoder((16, 24, 32, 48)).double()


def value_and_gradients(encode, net, points, weight):
    net.zero_grad()
    code = encode(points)
    (code * weight).sum().backward()
    return code.detach(), {name: p.grad.clone() for name, p in net.named_parameters()}


def assert_same(net, points, twin, skip=()):
    weight = clouds(99, len(points), 48)
    code, gradients = value_and_gradients(lambda x: encode_winners(net, x), net, points, weight)
    expected, slow = value_and_gradients(twin, net, points, weight)
    torch.testing.assert_close(code, expected, atol=1e-12, rtol=0)
    assert set(gradients) == set(slow)
    for name in set(slow) - set(skip):
        size = float(slow[name].abs().max())
        assert size > 0, name
        torch.testing.assert_close(gradients[name], slow[name], atol=1e-12 * size, rtol=0)


@pytest.mark.parametrize("count", [1, 2, 63, 200])
@pytest.mark.parametrize("batch", [1, 5])
def test_same_code_and_gradients(count, batch):
    net = encoder(count)
    points = clouds(batch, batch, count, 3)
    assert_same(net, points, net)
    assert_same(net, points, lambda x: naive.encode(net, x))


def test_threads_change_no_bit():
    net, points = encoder().float(), clouds(3, 7, 90, 3).float()
    found = []
    for count in (1, 4):
        with exact_on(count):
            found.append(value_and_gradients(lambda x: encode_winners(net, x), net, points, 1.0))
    (code, gradients), (other, others) = found
    assert torch.equal(code, other)
    assert all(torch.equal(gradients[name], others[name]) for name in gradients)


def test_repeated_points():
    """Scans are resampled with replacement: the dense maximum shares its gradient among copies."""
    net = encoder(1)
    points = clouds(7, 3, 20, 3)
    pick = torch.randint(20, (90,), generator=torch.Generator().manual_seed(0))
    assert_same(net, points[:, pick], net)
    assert_same(net, points[:, :1].expand(-1, 30, -1), net)


def test_ties_between_different_points():
    """Points that differ in z alone, which the first layer does not see: every maximum is a tie.

    Any of them may take the gradient of the weights on z; all other gradients are determined.
    """
    net = encoder(2)
    with torch.no_grad():
        net.point1.weight[:, 2] = 0
    points = clouds(8, 2, 40, 3)
    points[:, 20:, :2] = points[:, :20, :2]
    assert_same(net, points, net, skip=["point1.weight"])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_repeated_points_are_scored_once(dtype):
    points = clouds(12, 3, 40, 3).to(dtype)
    pick = torch.randint(40, (3, 100), generator=torch.Generator().manual_seed(1))
    pick[2] = 7
    resampled = points.gather(1, pick[..., None].expand(-1, -1, 3)).mT.contiguous().mT
    for rows, drawn in zip(distinct_rows(resampled), pick.tolist()):
        assert rows.tolist() == sorted({point: drawn.index(point) for point in drawn}.values())
    assert [rows.tolist() for rows in distinct_rows(points[:, :1])] == [[0], [0], [0]]


def test_dead_units():
    """Where no point lights a unit all tie at zero, and nothing may leak into its gradient."""
    net = encoder(3)
    with torch.no_grad():
        net.join_point.bias[:8] = -1e3
        net.point1.bias[:4] = -1e3
    assert_same(net, clouds(9, 3, 50, 3), net)


def test_training_and_inference_give_the_same_code():
    net = encoder(4).float()
    points = clouds(10, 4, 300, 3).float()
    with torch.no_grad():
        dense = net(points)
    torch.testing.assert_close(encode_winners(net, points).detach(), dense, atol=1e-5, rtol=1e-5)


def test_weights_that_are_not_finite_give_a_code_that_is_not():
    net = encoder(5)
    with torch.no_grad():
        net.point1.bias.fill_(torch.nan)
    assert encode_winners(net, clouds(11, 2, 20, 3)).isnan().all()


def test_a_search_in_bfloat16_loses_no_more_than_its_rounding():
    """Winners found in bfloat16: their own values, just below the maximum at worst."""
    net = encoder(4).float()
    points = clouds(13, 4, 300, 3).float()
    exact = net(points).detach()
    found = encode_winners(net, points, torch.bfloat16)
    found.sum().backward()
    size = exact.abs().amax(1, keepdim=True)
    assert bool((found <= exact + 1e-5 * size).all())
    assert bool((found >= exact - 0.03 * size).all())
    assert 0 < float((found < exact - 1e-6 * size).float().mean()) < 0.5
    assert all(bool(p.grad.isfinite().all()) for p in net.parameters() if p.grad is not None)


def test_no_gradient_is_summed_in_an_order_that_threads_decide():
    """torch adds with `index_put` by all threads at once: two trainings of one seed differed."""
    called = set()

    class Watched(TorchDispatchMode):
        def __torch_dispatch__(self, func, types, args=(), kwargs=None):
            called.add(func.overloadpacket.__name__)
            return func(*args, **(kwargs or {}))

    net = encoder()
    with Watched():
        encode_winners(net, clouds(0, 5, 63, 3)).sum().backward()
    assert "index_add" in called
    assert not {"index_put", "index_put_", "_index_put_impl_"} & called
