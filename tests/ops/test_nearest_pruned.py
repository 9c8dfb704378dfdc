# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Leaving blocks out loses nothing: clouds of many blocks against the reference, to the bit.

Whole numbers below 1,000: every square and sum is exact in float32, fused or not, so that values
and indices must be equal, and ties are many.
"""

import pytest
import torch

from wildshape.ops.library import library
from wildshape.ops.nearest import nearest, nearest_both, nearest_distance
from wildshape.ops.nearest.nearest_native import nearest_both_native, nearest_native
from wildshape.ops.nearest.nearest_torch import nearest_reference

pytestmark = pytest.mark.skipif(library() is None, reason="native library not built")


def levels() -> list[int]:
    loaded = library()
    return list(range(loaded.wildshape_level() + 1)) if loaded else [0]


def whole(count: int, low: int, high: int, seed: int) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randint(low, high, (2, count, 3), generator=generator).float()


def shell(count: int, seed: int) -> torch.Tensor:
    unit = torch.nn.functional.normalize(whole(count, -500, 500, seed) + 0.5, dim=-1)
    return (unit * torch.tensor([400.0, 150.0, 100.0])).round()


SCENES = {
    "shells": (shell(700, 0), shell(1100, 1)),
    "volume": (whole(333, 0, 900, 2), whole(517, 0, 900, 3)),
    "ties in many blocks": (whole(300, 0, 6, 4), whole(500, 0, 6, 5)),
    "drawn with replacement": (shell(200, 6), shell(90, 7)[:, torch.arange(400) % 90]),
    "all points equal": (whole(100, 3, 4, 8), whole(100, 3, 4, 9)),
    "far apart": (whole(200, 0, 50, 10), whole(300, 700, 750, 11)),
    "a line": (whole(150, 0, 900, 12) * torch.tensor([1, 0, 0]), whole(200, 0, 900, 13)),
    "an outlier": (
        whole(200, 0, 30, 14),
        torch.cat((whole(300, 0, 30, 15), whole(1, 990, 991, 16)), 1),
    ),
    "one block and its neighbour": (whole(17, 0, 90, 17), whole(16, 0, 90, 18)),
}


@pytest.mark.parametrize("level", levels())
@pytest.mark.parametrize("scene", SCENES)
def test_equal_to_the_reference(scene, level):
    a, b = SCENES[scene]
    for found, query, target in zip(nearest_both_native(a, b, level=level), (a, b), (b, a)):
        expected = nearest_reference(query, target)
        assert torch.equal(found.distance_squared, expected.distance_squared)
        assert torch.equal(found.index, expected.index)


@pytest.mark.parametrize("level", levels())
def test_ragged_both_ways(level):
    a, b = shell(150, 0), shell(260, 1)
    for sizes in ((150, 0), (17, 33), (1, 150), (0, 0)):
        n, m = torch.tensor(sizes), torch.tensor(sizes).flip(0)
        there, back = nearest_both_native(a, b, n, m, level=level)
        for found, expected in (
            (there, nearest_reference(a, b, n, m)),
            (back, nearest_reference(b, a, m, n)),
        ):
            assert torch.equal(found.distance_squared, expected.distance_squared)
            assert torch.equal(found.index, expected.index)


def test_one_way_and_both_ways_are_one_search():
    a, b = (torch.randn(3, n, 3, generator=torch.Generator().manual_seed(n)) for n in (90, 210))
    there, back = nearest_both(a, b)
    for found, expected in ((there, nearest_native(a, b)), (back, nearest(b, a))):
        assert torch.equal(found.distance_squared, expected.distance_squared)
        assert torch.equal(found.index, expected.index)


@pytest.mark.parametrize("level", levels())
def test_broken_targets_are_never_found(level):
    """Points that are not finite are against the contract; what is finite is found all the same."""
    a, b = shell(80, 0), shell(120, 1)
    b[0, 7], b[0, 50], b[1] = torch.nan, torch.inf, torch.nan
    found = nearest_native(a, b, level=level)
    finite = torch.cat((b[:1, :7], b[:1, 8:50], b[:1, 51:]), 1)
    expected = nearest_reference(a[:1], finite)
    assert torch.equal(found.distance_squared[:1], expected.distance_squared)
    assert found.distance_squared[1].isinf().all()
    assert not found.index[1].any()


@pytest.mark.parametrize("forced", ["torch", "native"])
def test_deterministic_algorithms_are_allowed_and_repeat(forced, monkeypatch):
    monkeypatch.setenv("WILDSHAPE_NEAREST", forced)
    a, b = shell(300, 0) / 100, shell(40, 1) / 100  # many queries to a target: sums of many
    gradients = []
    torch.use_deterministic_algorithms(True)
    try:
        for _ in range(2):
            x, y = a.clone().requires_grad_(), b.clone().requires_grad_()
            (nearest_distance(x, y).sum() + nearest_distance(y, x).sum()).backward()
            gradients.append((x.grad, y.grad))
    finally:
        torch.use_deterministic_algorithms(False)
    for first, second in zip(*gradients):
        assert torch.equal(first, second)


def test_gradient_is_the_same_at_any_number_of_threads():
    a, b = shell(900, 0) / 100, shell(700, 1) / 100
    found, threads = [], torch.get_num_threads()
    try:
        for count in (1, 3):
            torch.set_num_threads(count)
            x, y = a.repeat(40, 1, 1).requires_grad_(), b.repeat(40, 1, 1).requires_grad_()
            nearest_distance(x, y).sum().backward()
            found.append((x.grad, y.grad))
    finally:
        torch.set_num_threads(threads)
    for first, second in zip(*found):
        assert torch.equal(first, second)
