# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Planes of neighbourhoods against eigenvectors; turns about vectors against the exponential."""

import pytest
import torch

from wildshape.geometry.surface import planes, planes_torch, thinnest_axis
from wildshape.geometry.transforms.rotation import cross_matrix, rotation_from_vector

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def test_planes_are_those_of_eigenvectors():
    generator = torch.Generator().manual_seed(0)
    points = torch.randn(2, 40, 3, generator=generator, dtype=torch.float64)
    around = torch.randint(0, 40, (2, 30, 6), generator=generator)
    middle, normal = planes(points, around)
    for b in range(2):
        near = points[b][around[b]]
        torch.testing.assert_close(middle[b], near.mean(1))
        off = near - near.mean(1, keepdim=True)
        exact = torch.linalg.eigh(off.mT @ off).eigenvectors[:, :, 0]
        torch.testing.assert_close((normal[b] * exact).sum(-1).abs(), torch.ones(30).double())


def test_flat_needle_and_point():
    """A flat patch has its own normal, a needle one across it, equal points none at all."""
    patch = torch.tensor([[2.0, 0, 0], [0, 1, 0], [0, 0, 0.0]], dtype=torch.float64)
    needle = torch.diag(torch.tensor((0.0, 0.0, 3.0), dtype=torch.float64))
    matrices = torch.stack((patch, needle, torch.zeros(3, 3, dtype=torch.float64)))
    found = thinnest_axis(torch.stack([matrices[:, i, j] for i, j in PAIRS]))
    torch.testing.assert_close(found[0].abs(), torch.tensor((0.0, 0, 1)).double())
    assert abs(float(found[1, 2])) < 1e-6
    assert found.isfinite().all()


@pytest.mark.parametrize("size", [1e-12, 1e-4, 1.0, 1e4])
@pytest.mark.parametrize("find", [planes, planes_torch])
def test_planes_do_not_hang_on_the_size_of_a_cloud(find, size):
    generator = torch.Generator().manual_seed(1)
    points = torch.randn(1, 40, 3, generator=generator, dtype=torch.float64)
    around = torch.randint(0, 40, (1, 30, 6), generator=generator)
    expected, found = find(points, around)[1], find(size * points, around)[1]
    torch.testing.assert_close((found * expected).sum(-1).abs(), torch.ones(1, 30).double())


@pytest.mark.parametrize("size", [1e-12, 1.0])
@pytest.mark.parametrize("find", [planes, planes_torch])
def test_normals_of_needles_are_unit_vectors_across_them(find, size):
    generator = torch.Generator().manual_seed(2)
    along = torch.nn.functional.normalize(torch.randn(8, 1, 3, generator=generator), dim=-1)
    points = size * torch.randn(8, 40, 1, generator=generator) * along
    normal = find(points, torch.randint(0, 40, (8, 30, 6), generator=generator))[1]
    torch.testing.assert_close(normal.norm(dim=-1), torch.ones(8, 30))
    assert float((normal * along).sum(-1).abs().max()) < 1e-6


def test_turn_about_a_vector():
    vectors = torch.tensor(((0.0, 0, 0), (1e-9, 0, 0), (0.3, -0.2, 0.9), (0, 3.0, 0))).double()
    exact = torch.linalg.matrix_exp(cross_matrix(vectors))
    torch.testing.assert_close(rotation_from_vector(vectors), exact)
