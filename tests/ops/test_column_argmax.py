# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The first row of each column's maximum, whatever the backend; NaN never goes unnoticed."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from wildshape.ops.column_argmax import column_argmax, column_argmax_native, column_argmax_torch
from wildshape.ops.library import library

needs_library = pytest.mark.skipif(library() is None, reason="native library not built")
BACKENDS = [
    pytest.param(column_argmax_torch, id="torch"),
    pytest.param(column_argmax_native, id="native", marks=needs_library),
    pytest.param(lambda v: column_argmax_native(v, 0), id="portable", marks=needs_library),
    pytest.param(column_argmax, id="door"),
]


def naive(values):
    rows = []
    for column in values.T.tolist():
        broken = any(math.isnan(value) for value in column)
        rows.append(len(column) - 1 if broken else column.index(max(column)))
    return rows


@pytest.mark.parametrize("backend", BACKENDS)
@settings(max_examples=40, deadline=None)
@given(st.integers(1, 40), st.sampled_from([1, 7, 8, 33, 255, 300, 513]), st.integers(0, 999))
def test_backend_is_the_loop(backend, rows, columns, seed):
    """Few different values, so that ties are common; signed zeros, infinities, NaN among them."""
    generator = torch.Generator().manual_seed(seed)
    special = torch.tensor((0.0, -0.0, 1.5, -2.0, -torch.inf, -torch.inf, -1e-40, torch.inf))
    values = special[torch.randint(8, (rows, columns), generator=generator)]
    values[:, ::3] = torch.randn(values[:, ::3].shape, generator=generator)
    values[:, 1::5] = -torch.inf
    values[seed % rows, 2::7] = torch.nan
    assert backend(values).tolist() == naive(values)


@pytest.mark.parametrize("backend", BACKENDS)
def test_any_layout_is_read(backend):
    values = torch.randn(50, 90, generator=torch.Generator().manual_seed(0))
    assert torch.equal(backend(values.T), values.argmax(1))
    assert torch.equal(backend(values[3:, 10:40]), values[3:, 10:40].argmax(0))


def test_other_types_and_no_library(monkeypatch):
    values = torch.randn(30, 20, generator=torch.Generator().manual_seed(1))
    assert torch.equal(column_argmax(values.double()), values.argmax(0))
    monkeypatch.setattr("wildshape.ops.column_argmax.library", lambda: None)
    assert torch.equal(column_argmax(values), values.argmax(0))
