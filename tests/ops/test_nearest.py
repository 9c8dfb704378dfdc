# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every backend against the loop, in value, index and gradient; the promises of the door."""

from functools import partial

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.ops import naive

from wildshape.errors import BadInputError
from wildshape.ops import nearest as door
from wildshape.ops.library import library
from wildshape.ops.nearest import Neighbours, nearest, nearest_both, nearest_distance
from wildshape.ops.nearest.nearest_native import nearest_native
from wildshape.ops.nearest.nearest_torch import nearest_blocked, nearest_reference

needs_library = pytest.mark.skipif(library() is None, reason="native library not built")


def widest() -> int:
    loaded = library()
    return loaded.wildshape_level() if loaded else 0


def native(level: int):
    reason = "native library not built or instruction set absent"
    lacking = library() is None or level > widest()
    mark = pytest.mark.skipif(lacking, reason=reason)
    return pytest.param(partial(nearest_native, level=level), id=f"native-{level}", marks=mark)


BACKENDS = [
    pytest.param(nearest_reference, id="reference"),
    pytest.param(nearest_blocked, id="blocked"),
    native(0),
    native(1),
    native(2),
]
SHAPES = [(1, 1, 1), (2, 3, 5), (3, 17, 64), (1, 65, 63), (2, 5, 130), (1, 33, 1), (4, 1, 9)]
EMPTY = [(0, 3, 4), (2, 0, 4), (2, 3, 0), (0, 0, 0), (2, 0, 0)]


def clouds(B: int, N: int, M: int, seed: int = 0, grid: bool = False):
    """Random float32 clouds; on a small integer grid there are many exact ties."""
    generator = torch.Generator().manual_seed(seed)
    if grid:
        make = partial(torch.randint, 0, 3, generator=generator)
        return make((B, N, 3)).float(), make((B, M, 3)).float()
    return torch.randn(B, N, 3, generator=generator), torch.randn(B, M, 3, generator=generator)


def agrees(found: Neighbours, query, target, *sizes) -> None:
    squared, index = naive.nearest(query, target, *sizes)
    assert found.distance_squared.dtype == query.dtype
    torch.testing.assert_close(found.distance_squared.double(), squared, rtol=1e-6, atol=1e-12)
    assert torch.equal(found.index, index)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("shape", SHAPES + EMPTY, ids=str)
def test_backend_is_the_loop(backend, shape):
    query, target = clouds(*shape)
    agrees(backend(query, target), query, target)


@pytest.mark.parametrize("backend", BACKENDS)
def test_ties_go_to_the_smallest_index(backend):
    query, target = clouds(2, 40, 150, grid=True)
    agrees(backend(query, target), query, target)


@pytest.mark.parametrize("backend", BACKENDS)
def test_ragged_rows_ignore_padding(backend):
    query, target = clouds(4, 20, 70)
    query_sizes, target_sizes = torch.tensor([20, 0, 7, 1]), torch.tensor([1, 70, 0, 65])
    target[0, 1:], target[2] = query[0, 0], torch.nan  # padding that must not be found
    found = backend(query, target, query_sizes, target_sizes)
    agrees(found, query, target, query_sizes, target_sizes)
    assert torch.isinf(found.distance_squared[2, :7]).all()
    assert not found.distance_squared[2, 7:].any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_any_layout_is_read(backend):
    query, target = clouds(3, 12, 30)
    expected = backend(query, target)
    layouts = [
        (query.mT.contiguous().mT, target.mT.contiguous().mT),
        (torch.cat((query, query), 2)[..., :3], torch.cat((target, target), 1)[:, :30]),
        (query.transpose(0, 1).contiguous().transpose(0, 1), target),
    ]
    for q, t in layouts:
        found = backend(q, t)
        assert torch.equal(found.index, expected.index)
        assert torch.equal(found.distance_squared, expected.distance_squared)
    repeated = backend(query[:1].expand(3, -1, -1), target)
    assert torch.equal(repeated.index[0], expected.index[0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_far_and_broken_points_keep_indices_legal(backend):
    query, target = clouds(1, 10, 70)
    query[0, 3], query[0, 4], query[0, 5] = torch.nan, torch.inf, 1e30
    found = backend(query, target)
    assert ((found.index >= 0) & (found.index < 70)).all()
    assert not found.distance_squared[0, 3:6].isfinite().any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("count", [2, 16, 40])
def test_points_that_are_not_finite_find_nothing_and_are_never_found(backend, count):
    """Where inf - inf was taken for a distance of zero, memory past the clouds was searched."""
    query, target = clouds(1, count, 16)
    query[0, 0], query[0, 1, 2] = torch.inf, -torch.inf
    target[0, 3], target[0, 9, 1], target[0, 5] = -torch.inf, torch.inf, torch.nan
    found = backend(query, target)
    assert found.distance_squared[0, :2].tolist() == [torch.inf, torch.inf]
    assert found.index[0, :2].tolist() == [0, 0]
    legal = [i for i in range(16) if i not in (3, 5, 9)]
    squared, index = naive.nearest(query[:, 2:], target[:, legal])
    torch.testing.assert_close(found.distance_squared[:, 2:].double(), squared)
    assert torch.equal(found.index[:, 2:], torch.tensor(legal)[index])


@pytest.mark.parametrize("backend", BACKENDS)
@settings(max_examples=25, deadline=None)
@given(st.integers(1, 3), st.integers(1, 40), st.integers(1, 140), st.integers(0, 999))
def test_backends_agree_with_the_reference_in_float64(backend, B, N, M, seed):
    query, target = clouds(B, N, M, seed)
    found, exact = backend(query, target), nearest_reference(query.double(), target.double())
    rows = torch.arange(B)[:, None]
    chosen = (query - target[rows, found.index]).double().square().sum(-1)
    torch.testing.assert_close(chosen, exact.distance_squared, rtol=1e-6, atol=1e-12)
    torch.testing.assert_close(found.distance_squared.double(), chosen, rtol=1e-6, atol=1e-12)


@needs_library
@pytest.mark.parametrize(("B", "N", "M"), [(1, 700, 900), (9, 300, 400), (2, 257, 2049)])
def test_threads_change_nothing(B, N, M):
    query, target = clouds(B, N, M)
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        alone = nearest_native(query, target)
        torch.set_num_threads(3)
        together = nearest_native(query, target)
    finally:
        torch.set_num_threads(threads)
    assert torch.equal(alone.index, together.index)
    assert torch.equal(alone.distance_squared, together.distance_squared)


@pytest.fixture(params=["torch", "native"])
def forced(request, monkeypatch):
    """The name of the backend that answers."""
    if request.param == "native" and library() is None:
        pytest.skip("native library not built")
    monkeypatch.setenv("WILDSHAPE_NEAREST", request.param)
    return request.param


@pytest.mark.parametrize("forced", ["torch", "native", "reference"], indirect=True)
def test_permuted_targets_give_permuted_indices(forced):
    assert door.backend() == forced
    query, target = clouds(2, 50, 80)
    order = torch.randperm(80, generator=torch.Generator().manual_seed(1))
    found, permuted = nearest(query, target), nearest(query, target[:, order])
    assert torch.equal(order[permuted.index], found.index)
    assert torch.equal(permuted.distance_squared, found.distance_squared)


def test_both_ways_is_two_searches():
    a, b = clouds(2, 20, 30)
    sizes_a, sizes_b = torch.tensor([20, 4]), torch.tensor([0, 30])
    there, back = nearest_both(a, b, sizes_a, sizes_b)
    agrees(there, a, b, sizes_a, sizes_b)
    agrees(back, b, a, sizes_b, sizes_a)


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 9, 5), (3, 30, 7)], ids=str)
def test_gradient_is_the_loop(forced, shape):
    query, target = (x.requires_grad_() for x in clouds(*shape))
    weight = torch.rand(shape[:2], generator=torch.Generator().manual_seed(2))
    found = nearest(query, target)
    assert not found.distance_squared.requires_grad
    (nearest_distance(query, target, found) * weight).sum().backward()
    expected = naive.distance_gradient(query.detach(), target.detach(), found.index, weight)
    torch.testing.assert_close(query.grad, expected[0].float(), rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(target.grad, expected[1].float(), rtol=1e-5, atol=1e-6)


def test_gradient_at_zero_distance_in_padding_and_without_target_is_zero(forced):
    query, target = (x.requires_grad_() for x in clouds(3, 6, 8))
    with torch.no_grad():
        target[0, :6] = query[0]
    found = nearest(query, target, torch.tensor([6, 2, 6]), torch.tensor([8, 8, 0]))
    distance = nearest_distance(query, target, found)
    assert not distance[0].any()
    assert not distance[1, 2:].any()
    assert distance[2].isinf().all()
    distance[distance.isfinite()].sum().backward()
    assert query.grad is not None
    assert target.grad is not None
    assert torch.isfinite(query.grad).all()
    assert not query.grad[0].any()
    assert not query.grad[1, 2:].any()
    assert not query.grad[2].any()
    assert not target.grad[[0, 2]].any()
    assert query.grad[1, :2].norm(dim=-1).allclose(torch.ones(2))


def test_gradient_of_points_that_are_not_finite_is_zero(forced):
    query, target = (x.requires_grad_() for x in clouds(1, 6, 8))
    with torch.no_grad():
        query[0, 0], query[0, 1, 1], target[0, 0] = torch.inf, torch.nan, -torch.inf
    distance = nearest_distance(query, target)
    assert distance[0, :2].isinf().all()
    distance[0, 2:].sum().backward()
    assert query.grad is not None
    assert target.grad is not None
    assert not query.grad[0, :2].any()
    assert query.grad[0, 2:].norm(dim=-1).allclose(torch.ones(4))
    assert target.grad.isfinite().all()
    assert not target.grad[0, 0].any()


def test_gradcheck_in_float64():
    query, target = (x.double().requires_grad_() for x in clouds(2, 7, 9))
    assert torch.autograd.gradcheck(nearest_distance, (query, target))


def test_gradient_through_expanded_and_strided_inputs(forced):
    scan, shapes = (x.requires_grad_() for x in clouds(1, 20, 15))
    posed = shapes.expand(4, -1, -1) * torch.arange(1.0, 5.0)[:, None, None]
    nearest_distance(scan.expand(4, -1, -1), posed).sum().backward()
    exact_scan, exact_shapes = (x.detach().double().requires_grad_() for x in (scan, shapes))
    posed = exact_shapes.expand(4, -1, -1) * torch.arange(1.0, 5.0)[:, None, None]
    nearest_distance(exact_scan.expand(4, -1, -1), posed).sum().backward()
    assert exact_scan.grad is not None
    assert exact_shapes.grad is not None
    torch.testing.assert_close(scan.grad, exact_scan.grad.float(), rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(shapes.grad, exact_shapes.grad.float(), rtol=1e-4, atol=1e-5)


def test_half_types_are_searched_in_float32():
    query, target = (x.bfloat16().requires_grad_() for x in clouds(2, 9, 20))
    agrees(nearest(query, target), query.detach().float(), target.detach().float())
    nearest_distance(query, target).sum().backward()
    assert query.grad is not None
    assert query.grad.dtype == torch.bfloat16


def test_no_targets_at_all():
    query = torch.zeros(2, 3, 3, requires_grad=True)
    assert nearest_distance(query, torch.zeros(2, 0, 3)).isinf().all()


def test_unknown_backend_is_refused(monkeypatch):
    monkeypatch.setenv("WILDSHAPE_NEAREST", "open3d")
    with pytest.raises(BadInputError, match="open3d"):
        nearest(*clouds(1, 2, 2))


def test_without_the_library_the_torch_form_answers(monkeypatch):
    monkeypatch.delenv("WILDSHAPE_NEAREST", raising=False)
    monkeypatch.setattr(door, "library", lambda: None)
    assert door.backend() == "torch"
    query, target = clouds(2, 20, 30)
    agrees(nearest(query, target), query, target)
    monkeypatch.setenv("WILDSHAPE_NEAREST", "native")
    with pytest.raises(BadInputError, match="not built"):
        nearest(query, target)
