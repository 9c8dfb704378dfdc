# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How far points reach: the kernel against the same sums in numpy, and a square by hand."""

import numpy as np
import pytest

from wildshape.ops.library import added_kernel
from wildshape.ops.spans import spans, spans_numpy


@pytest.mark.skipif(added_kernel("spans") is None, reason="no kernels")
@pytest.mark.parametrize("count", [1, 2, 500])
def test_the_kernel_gives_the_same_numbers_as_numpy_also_of_every_third_point(count):
    rng = np.random.default_rng(count)
    points = rng.normal(scale=20.0, size=(3 * count, 3)).astype(np.float32)
    directions = rng.normal(size=(2, 90))
    for some in (points, points[::3]):
        for found, expected in zip(spans(some, directions), spans_numpy(some, directions)):
            assert np.array_equal(found, expected)


def test_a_square_reaches_along_its_diagonal_by_the_diagonal(monkeypatch):
    corners = np.array(((0, 0, 9), (2, 0, 8), (2, 2, 7), (0, 2, 6)), np.float32)
    directions = np.array(((1.0, np.sqrt(0.5)), (0.0, np.sqrt(0.5))))
    for kernel in (added_kernel, lambda _: None):
        monkeypatch.setattr("wildshape.ops.spans.added_kernel", kernel)
        least, most = spans(corners, directions)
        np.testing.assert_allclose(least, (0.0, 0.0))
        np.testing.assert_allclose(most, (2.0, np.sqrt(8.0)))
