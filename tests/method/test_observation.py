# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests import naive
from tests.strategies import clouds, poses

from wildshape.method.observation import chamfer, masked_mean, one_way_chamfer


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 9), (17, 4), (40, 40)])
def test_equal_to_the_double_loop(dtype, n, m):
    a, b = clouds(n, 2, n, 3).to(dtype), clouds(m + 50, 2, m, 3).to(dtype)
    expected = torch.tensor([naive.one_way(x, y) for x, y in zip(a, b)], dtype=dtype)
    torch.testing.assert_close(one_way_chamfer(a, b), expected)
    backward = torch.tensor([naive.one_way(y, x) for x, y in zip(a, b)], dtype=dtype)
    torch.testing.assert_close(chamfer(a, b), expected + backward)


def test_hand_computed():
    """Euclidean, not squared, each side a mean of its own points, summed and not halved."""
    a = torch.tensor([[[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]])
    b = torch.tensor([[[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, -7.0]]])
    assert float(one_way_chamfer(a, b)) == pytest.approx((0 + 5) / 2)
    assert float(one_way_chamfer(b, a)) == pytest.approx((0 + 2 + 7) / 3)
    assert float(chamfer(a, b)) == pytest.approx(5.5)


def test_zero_for_a_cloud_and_itself():
    a = clouds(0, 1, 30, 3).float()
    assert float(chamfer(a, a.flip(1))) == 0


@given(poses(), st.integers(0, 20))
def test_rigid_invariance(T, seed):
    a, b = clouds(seed, 1, 12, 3), clouds(seed + 100, 1, 15, 3)
    moved = chamfer(T.apply(a), T.apply(b))
    torch.testing.assert_close(moved, chamfer(a, b), atol=1e-9, rtol=0)


@given(st.integers(0, 50))
def test_order_does_not_matter_and_sides_may_be_swapped(seed):
    a, b = clouds(seed, 1, 12, 3), clouds(seed + 100, 1, 15, 3)
    order = torch.randperm(15, generator=torch.Generator().manual_seed(seed))
    torch.testing.assert_close(chamfer(a, b[:, order]), chamfer(a, b))
    torch.testing.assert_close(chamfer(b, a), chamfer(a, b))


def test_only_counted_points_are_counted():
    a, b = clouds(1, 2, 10, 3), clouds(2, 2, 7, 3)
    counted = torch.zeros(2, 10, dtype=torch.bool)
    counted[0, [1, 4, 5]] = True
    expected = naive.one_way(a[0, [1, 4, 5]], b[0])
    found = one_way_chamfer(a, b, counted)
    assert float(found[0]) == pytest.approx(expected)
    assert float(found[1]) == 0


def test_mean_over_nothing_is_zero_and_has_a_gradient():
    values = torch.ones(1, 3, requires_grad=True)
    masked_mean(values, torch.zeros(1, 3, dtype=torch.bool)).sum().backward()
    assert values.grad is not None
    assert torch.equal(values.grad, torch.zeros(1, 3))


def test_gradcheck():
    a, b = clouds(3, 1, 5, 3).requires_grad_(), clouds(4, 1, 6, 3).requires_grad_()
    assert torch.autograd.gradcheck(chamfer, (a, b))


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_no_nan_where_points_coincide(dtype):
    a = clouds(5, 1, 8, 3).to(dtype).requires_grad_()
    b = a.detach().clone().requires_grad_()
    chamfer(a, b).sum().backward()
    for grad in (a.grad, b.grad):
        assert grad is not None
        assert grad.isfinite().all()
