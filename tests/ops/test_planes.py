# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Planes and the equations of points on planes: the kernels against torch, and by hand."""

import pytest
import torch
from torch import Tensor

from wildshape.geometry.surface import planes_torch
from wildshape.ops.library import added_kernel
from wildshape.ops.planes import planes_native
from wildshape.ops.point_to_plane import (
    point_to_plane,
    point_to_plane_native,
    point_to_plane_torch,
)

COMPILED = pytest.mark.skipif(
    added_kernel("planes") is None or added_kernel("point_to_plane") is None, reason="no kernels"
)


def scans(dtype=torch.float32, far=0.0) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Three scans of 50 points and a surface of 40, each point's counterpart, and a centre."""
    generator = torch.Generator().manual_seed(0)
    points = torch.randn(3, 50, 3, generator=generator, dtype=torch.float64) + far
    onto = torch.randn(40, 3, generator=generator, dtype=torch.float64) + far
    normals = torch.randn(40, 3, generator=generator, dtype=torch.float64)
    normals = torch.nn.functional.normalize(normals, dim=-1)
    counterpart = torch.randint(0, 40, (3, 50), generator=generator)
    centre = points.mean(1)
    a, b, c, d = (part.to(dtype) for part in (points, centre, onto, normals))
    return a, b, c, d, counterpart


@COMPILED
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("far", [0.0, 50.0])
def test_the_kernel_finds_the_planes_that_torch_finds(dtype, far):
    generator = torch.Generator().manual_seed(0)
    points = torch.randn(2, 60, 3, generator=generator, dtype=torch.float64) + far
    points = points.float().to(dtype)
    around = torch.randint(0, 60, (2, 30, 7), generator=generator)
    expected = planes_torch(points.double(), around)
    for found, exact in zip(planes_native(points, around), expected):
        assert found.dtype == dtype
        torch.testing.assert_close(found, exact.to(dtype), atol=1e-6, rtol=1e-6)


@COMPILED
def test_equal_points_have_some_plane_and_a_flat_patch_its_own():
    flat = torch.tensor(((0.0, 0, 5), (1, 0, 5), (0, 1, 5), (7, 7, 7)))[None]
    around = torch.tensor(((0, 1, 2), (3, 3, 3)))[None]
    middle, normal = planes_native(flat, around)
    assert middle[0].tolist() == pytest.approx(torch.tensor(((1 / 3, 1 / 3, 5), (7, 7, 7))))
    torch.testing.assert_close(normal[0].abs(), torch.tensor(((0.0, 0, 1), (0, 0, 1))))


@COMPILED
@pytest.mark.parametrize("far", [0.0, 50.0])
def test_the_kernel_gives_the_equations_that_torch_gives(far):
    expected = point_to_plane_torch(*scans(torch.float64, far), width=0.5, holding=0.1)
    found = point_to_plane_native(*scans(far=far), width=0.5, holding=0.1)
    for part, exact in zip(found, expected):
        torch.testing.assert_close(part, exact.float(), atol=2e-4, rtol=2e-4)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_step_is_newton_s_of_the_weighted_squared_distances(dtype):
    """b is the gradient, A the Gauss-Newton matrix, by automatic differentiation, weights held."""
    points, centre, onto, normals, counterpart = scans(dtype)
    found = point_to_plane(points, centre, onto, normals, counterpart, 0.5, 0.1)
    exact = scans(torch.float64)
    off = exact[0] - exact[2][counterpart]
    weight = (1 + off.square().sum(-1) / 0.25) ** -2
    axes = torch.eye(3).double().expand(3, 50, 3, 3)
    along = torch.cat((exact[3][counterpart][..., None, :], axes), dim=-2)
    share = torch.tensor((1.0, 0.1, 0.1, 0.1)).double()

    def residuals(motion):
        moved = torch.linalg.cross(motion[:3].expand_as(exact[0]), exact[0] - exact[1][:, None])
        return (along @ (off + moved + motion[3:])[..., None])[..., 0]

    still = torch.zeros(6).double()
    J, r = torch.autograd.functional.jacobian(residuals, still), residuals(still)
    heavy = weight[..., None] * share
    A = torch.einsum("vnk,vnki,vnkj->vij", heavy, J, J)
    b = torch.einsum("vnk,vnki,vnk->vi", heavy, J, r)
    for part, expected in zip(found, (A, b, weight.sum(1))):
        torch.testing.assert_close(part.double(), expected, atol=2e-5, rtol=2e-5)


@COMPILED
def test_places_out_of_reach_are_refused():
    points, centre, onto, normals, counterpart = scans()
    for wrong in (counterpart + 40, counterpart - 40):
        with pytest.raises(IndexError):
            point_to_plane_native(points, centre, onto, normals, wrong, 0.5, 0.1)
        with pytest.raises(IndexError):
            planes_native(onto[None], wrong[None])
    with pytest.raises(IndexError):
        planes_native(onto[None], counterpart[None, :, :0])
