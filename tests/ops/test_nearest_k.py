# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The k nearest neighbours: every instruction set against plain torch, and that against a sort."""

import math
from functools import partial

import pytest
import torch
from tests.ops.test_nearest import clouds, needs_library, widest
from tests.refusal import refused

from wildshape.ops.nearest import nearest, nearest_k
from wildshape.ops.nearest.nearest_k import (
    check_k,
    nearest_k_native,
    nearest_k_torch,
    nearest_k_trees,
)
from wildshape.ops.threads import exact_on

SHAPES = [
    (1, 1, 1, 1),
    (2, 3, 5, 8),
    (3, 17, 64, 4),
    (2, 130, 300, 16),
    (2, 5, 0, 3),
    (1, 40, 33, 1),
]


def by_sorting(query, target, k, groups=None):
    """Nothing but the definition."""
    d2 = (query.double()[:, :, None] - target.double()[:, None]).square().sum(-1)
    if groups is not None:
        d2 = d2.masked_fill(groups[0][:, :, None] == groups[1][:, None], math.inf)
    order = d2.argsort(stable=True, dim=-1)[..., :k]
    squared = d2.gather(-1, order)
    return squared, order.masked_fill(squared.isinf(), 0)


def test_plain_torch_is_a_sort():
    query, target = clouds(2, 20, 50)
    squared, order = by_sorting(query, target, 7)
    found = nearest_k_torch(query, target, 7)
    assert torch.equal(found.index, order)
    torch.testing.assert_close(found.distance_squared.double(), squared, rtol=1e-5, atol=1e-9)


def test_trees_are_plain_torch():
    query, target = clouds(3, 30, 50)
    sizes = torch.tensor((31, -1, 7)), torch.tensor((3, 51, 0))  # beyond either end: that end
    for most in (math.inf, 0.7):
        own, plain = (
            way(query, target, 4, *sizes, most=most) for way in (nearest_k_trees, nearest_k_torch)
        )
        assert torch.equal(own.index, plain.index)
        torch.testing.assert_close(own.distance_squared, plain.distance_squared)


@needs_library
@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("grouped", [False, True])
def test_native_is_plain_torch(level, shape, grouped):
    if level > widest():
        pytest.skip("instruction set absent")
    B, N, M, k = shape
    query, target = clouds(B, N, M, seed=N)
    sizes = torch.arange(1, B + 1) * N // B, torch.arange(B) * M // B + 1
    groups = (torch.arange(B * N).view(B, N) % 3, torch.arange(B * M).view(B, M) % 3)
    given = (*sizes, groups if grouped else None)
    for most in (math.inf, 0.7):
        search = partial(nearest_k_native, level=level)
        own, plain = (way(query, target, k, *given, most) for way in (search, nearest_k_torch))
        assert torch.equal(own.index, plain.index)
        torch.testing.assert_close(own.distance_squared, plain.distance_squared)


@needs_library
@pytest.mark.parametrize("level", [0, 1, 2])
def test_groups_that_lie_apart_find_each_other(level):
    """Whole blocks are of one group, and are left out for its own queries alone."""
    if level > widest():
        pytest.skip("instruction set absent")
    query, target = (torch.cat((part, part + 9.0), 1) for part in clouds(2, 50, 90, grid=True))
    own, other = ((part[..., 0] > 5).long() for part in (query, target))
    lone = (torch.arange(180) == 15).long().expand(2, -1)  # the last of its block
    for some, groups in (
        (target, (own, other)),
        (target, (own, 1 - other)),
        (target, (own * 0, other * 0)),
        (target * 0, (own * 0, lone)),
    ):
        for k in (1, 4, 120):
            squared, order = by_sorting(query, some, k, groups)
            found = nearest_k_native(query, some, k, groups=groups, level=level)
            assert torch.equal(found.distance_squared.double(), squared)
            assert torch.equal(found.index, order)


@needs_library
def test_sizes_of_any_whole_type_are_read():
    query, target = clouds(4, 30, 40)
    sizes = torch.tensor((30, 0, 7, 12)), torch.tensor((3, 40, 9, 1))
    wide = nearest_k_native(query, target, 2, *sizes)
    narrow = nearest_k_native(query, target, 2, sizes[0].int(), sizes[1].int())
    assert torch.equal(wide.index, narrow.index)
    assert torch.equal(wide.distance_squared, narrow.distance_squared)


@needs_library
def test_threads_change_nothing():
    query, target = clouds(2, 1100, 1000)
    groups = (torch.arange(2200).view(2, -1) % 3, torch.arange(2000).view(2, -1) % 3)
    found, sizes = [], (torch.tensor((1100, 700)), torch.tensor((-1, 1000)))
    for threads in (1, 3, 100):
        with exact_on(threads):
            found.append(nearest_k_native(query, target, 4, *sizes, groups))
    for several in found[1:]:
        assert torch.equal(several.index, found[0].index)
        assert torch.equal(several.distance_squared, found[0].distance_squared)
    plain = nearest_k_torch(query, target, 4, *sizes, groups)
    assert torch.equal(found[0].index, plain.index)


@needs_library
def test_equal_distances_are_ordered_by_place():
    query, target = clouds(2, 40, 60, grid=True)
    squared, order = by_sorting(query, target, 12)
    found = nearest_k_native(query, target, 12)
    assert torch.equal(found.index, order)
    assert torch.equal(found.distance_squared.double(), squared)


def test_the_first_is_the_nearest_and_what_is_not_finite_is_nothing():
    query, target = clouds(2, 50, 80)
    query[0, 3], target[1, 5] = math.nan, math.inf
    first, nearest_one = nearest_k(query, target, 3), nearest(query, target)
    assert torch.equal(first.index[..., 0], nearest_one.index)
    torch.testing.assert_close(first.distance_squared[..., 0], nearest_one.distance_squared)
    assert not (first.index[1] == 5).any()


def test_what_does_not_fit_is_refused():
    query, target = clouds(2, 5, 6)
    refused(nearest_k, query, target, 0, match="at least 1")
    refused(check_k, query, target, 2, (torch.zeros(2, 5), torch.zeros(2, 6)), match="groups")
