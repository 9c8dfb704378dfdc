# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The visible subset: exactly one point an occupied bin, whatever the order or the backend."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.ops import naive

from wildshape.ops.library import library
from wildshape.ops.zbuffer import visible
from wildshape.ops.zbuffer.zbuffer_native import visible_native
from wildshape.ops.zbuffer.zbuffer_torch import visible_reference

needs_library = pytest.mark.skipif(library() is None, reason="native library not built")
BACKENDS = [
    pytest.param(visible_reference, id="torch"),
    pytest.param(visible_native, id="native", marks=needs_library),
    pytest.param(visible, id="door"),
]


def image(B: int, N: int, n_bins: int, seed: int = 0):
    """Bins partly outside the image; depths from a few values, so that ties are common."""
    generator = torch.Generator().manual_seed(seed)
    bins = torch.randint(-2, n_bins + 2, (B, N), generator=generator)
    return bins, torch.randint(-2, 4, (B, N), generator=generator).float()


@pytest.mark.parametrize("backend", BACKENDS)
@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 3),
    st.integers(0, 60),
    st.sampled_from([1, 2, 7, 50, 1000, 131072]),
    st.integers(0, 999),
)
def test_backend_is_the_loop(backend, B, N, n_bins, seed):
    bins, depth = image(B, N, n_bins, seed)
    assert torch.equal(backend(bins, depth, n_bins), naive.visible(bins, depth, n_bins))


@pytest.mark.parametrize("backend", BACKENDS)
def test_order_does_not_matter(backend):
    generator = torch.Generator().manual_seed(3)
    bins = torch.randint(0, 30, (2, 400), generator=generator)
    depth = torch.rand(2, 400, generator=generator)
    order = torch.randperm(400, generator=generator)
    assert torch.equal(
        backend(bins[:, order], depth[:, order], 30), backend(bins, depth, 30)[:, order]
    )


@pytest.mark.parametrize("backend", BACKENDS)
def test_special_depths(backend):
    depth = torch.tensor([[torch.nan, 5.0, -0.0, 0.0, torch.inf, torch.nan, -1.0, -2.0]])
    bins = torch.tensor([[0, 0, 1, 1, 2, 2, 3, 3]])
    seen = backend(bins, depth, 4)
    assert torch.equal(seen, naive.visible(bins, depth, 4))
    assert seen.tolist() == [[False, True, True, False, True, False, False, True]]


@pytest.mark.parametrize("backend", BACKENDS)
def test_strided_inputs(backend):
    bins, depth = image(40, 3, 20)
    expected = naive.visible(bins.T, depth.T, 20)
    assert torch.equal(backend(bins.T, depth.T, 20), expected)


@needs_library
def test_many_clouds_on_many_threads():
    bins, depth = image(64, 2048, 131072)
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(3)
        seen = visible_native(bins, depth, 131072)
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(seen, visible_reference(bins, depth, 131072))


def test_double_depth_and_no_gradient():
    bins = torch.tensor([[0, 0]])
    depth = torch.tensor([[2.0, 1.0]], dtype=torch.float64, requires_grad=True)
    assert visible(bins, depth, 1).tolist() == [[False, True]]
