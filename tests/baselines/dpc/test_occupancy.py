# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The differentiable projection against what can be worked out by hand."""

import math
from typing import NamedTuple

import pytest
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.baselines.dpc.occupancy import (
    gaussian,
    image_of,
    let_by,
    occupancy,
    project,
    smooth,
    splat,
)
from wildshape.baselines.dpc.viewing_volume import beyond, centres
from wildshape.geometry.transforms.rotation import rotation_z

SHARP = 0.2
EXACT = torch.zeros((), dtype=torch.float64)


def voxel(size, right, down, away):
    """Middle of a voxel as the only point of a cloud."""
    at = centres(size, EXACT)
    return torch.stack((at[right], at[down], at[away])).view(1, 1, 3)


def wall(away, size=16, each=2):
    """Points that fill a plane across all rays, several a pixel."""
    at = centres(size * each, EXACT)
    right, down = torch.meshgrid(at, at, indexing="ij")
    plane = torch.stack((right, down, torch.full_like(right, away)), dim=-1)
    return plane.view(1, -1, 3)


class Rays(NamedTuple):
    """Where each ray ends.

    Attributes:
        ends: probability of each voxel along the ray.
        escape: probability that it meets nothing; all sum to 1.
    """

    ends: Float[Tensor, "*batch S S S"]
    escape: Float[Tensor, "*batch S S"]


def rays_through(volume: Float[Tensor, "*batch S S S"]) -> Rays:
    """Where each ray ends: `o_k` times what `o_j < k` let by."""
    passed = let_by(volume)
    before = torch.cat((torch.ones_like(passed[..., :1, :, :]), passed[..., :-1, :, :]), dim=-3)
    return Rays(before - passed, passed[..., -1, :, :])


def test_a_single_point_lands_on_its_pixel():
    image = project(voxel(16, right=11, down=3, away=5), 16, SHARP)
    row, column = divmod(int(image.silhouette[0].argmax()), 16)
    assert (row, column) == (3, 11)
    assert image.silhouette[0, 3, 11] > 0.99
    assert image.silhouette[0].sum() == pytest.approx(1.0, abs=0.01)
    assert image.depth[0, 3, 11].item() == pytest.approx(centres(16, EXACT)[5].item(), abs=0.01)


def test_a_point_between_voxels_is_shared_and_none_of_it_is_lost():
    points = torch.rand(3, 40, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    points = (points - 0.5) * 0.9
    volume = splat(points, 16)
    torch.testing.assert_close(volume.sum((1, 2, 3)), torch.full((3,), 40.0, dtype=torch.float64))
    at = centres(16, points)
    mean = torch.stack(
        [torch.einsum(f"bkvu,{axis}->b", volume, at) for axis in ("u", "v", "k")], dim=-1
    )
    torch.testing.assert_close(mean, points.sum(1))


def test_what_leaves_the_cube_is_not_drawn_on_its_border():
    outside = torch.tensor([[[0.7, 0.0, 0.0], [0.0, -0.9, 0.0], [0.0, 0.0, 3.0]]])
    assert splat(outside, 8).sum() == 0


@pytest.mark.parametrize("sigma", [0.2, 1.0, 3.0])
def test_smoothing_is_a_gaussian_of_that_width(sigma):
    volume = torch.zeros(1, 33, 33, 33, dtype=torch.float64)
    volume[0, 16, 16, 16] = 1.0
    smoothed = smooth(volume, gaussian(33, sigma, volume))
    assert smoothed.sum().item() == pytest.approx(1.0, abs=1e-3)
    ratio = smoothed[0, 16, 17, 16] / smoothed[0, 16, 16, 16]
    assert ratio.item() == pytest.approx(math.exp(-0.5 / sigma**2), abs=1e-9)
    for axes in ((1, 2), (1, 3), (2, 3)):
        torch.testing.assert_close(smoothed, smoothed.transpose(*axes))


def test_a_ray_ends_somewhere_or_escapes():
    generator = torch.Generator().manual_seed(0)
    volume = torch.rand(2, 12, 12, 12, dtype=torch.float64, generator=generator)
    volume[0, 4] = 1.0
    volume[1, :, 0, 0] = 0.0
    rays = rays_through(volume)
    total = rays.ends.sum(1) + rays.escape
    torch.testing.assert_close(total, torch.ones_like(total))
    assert (rays.ends >= 0).all()
    assert rays.escape[1, 0, 0] == 1.0
    assert rays.escape[0].max() <= 1.1e-5


def test_termination_is_the_product_of_what_lets_by():
    volume = torch.tensor([0.2, 0.5, 0.0, 0.9], dtype=torch.float64)
    cube = volume.view(4, 1, 1).expand(4, 4, 4)
    rays = rays_through(cube)
    expected = torch.tensor([0.2, 0.8 * 0.5, 0.0, 0.8 * 0.5 * 0.9], dtype=torch.float64)
    torch.testing.assert_close(rays.ends[:, 2, 1], expected)
    assert rays.escape[0, 0].item() == pytest.approx(0.8 * 0.5 * 0.1)


@pytest.mark.parametrize("place", [2, 7, 12])
def test_the_depth_of_a_plane_is_its_distance(place):
    away = centres(16, EXACT)[place].item()
    image = project(wall(away), 16, SHARP)
    torch.testing.assert_close(image.depth, torch.full_like(image.depth, away), atol=1e-3, rtol=0)
    assert image.silhouette.min() > 0.999


def test_the_nearer_of_two_planes_is_seen():
    near, far = (centres(16, EXACT)[k].item() for k in (4, 10))
    both = torch.cat((wall(far), wall(near)), dim=1)
    depth = project(both, 16, SHARP).depth
    torch.testing.assert_close(depth, torch.full_like(depth, near), atol=1e-3, rtol=0)


def test_the_image_is_the_expectation_over_where_rays_end():
    generator = torch.Generator().manual_seed(3)
    volume = torch.rand(2, 9, 9, 9, dtype=torch.float64, generator=generator) ** 3
    image, rays = image_of(let_by(volume)), rays_through(volume)
    depth = torch.einsum("bkvu,k->bvu", rays.ends, centres(9, EXACT)) + beyond(9) * rays.escape
    torch.testing.assert_close(image.depth, depth)
    torch.testing.assert_close(image.silhouette, rays.ends.sum(1))


def test_empty_rays_are_as_deep_as_the_background_of_a_scan_s_image():
    empty = torch.zeros(1, 8, 8, 8, dtype=torch.float64)
    image = image_of(let_by(empty))
    assert image.silhouette.abs().max() == 0
    torch.testing.assert_close(image.depth, torch.full_like(image.depth, beyond(8)))


def test_gradients_are_those_of_finite_differences():
    generator = torch.Generator().manual_seed(1)
    points = (torch.rand(1, 5, 3, dtype=torch.float64, generator=generator) - 0.5) * 0.8
    strength = torch.tensor([0.7], dtype=torch.float64)

    def images(cloud, strong):
        return tuple(project(cloud, 6, 1.0, strong))

    assert torch.autograd.gradcheck(
        images, (points.requires_grad_(), strength.requires_grad_()), eps=1e-6, atol=1e-6
    )


def test_occupancy_stays_a_probability():
    crowd = torch.zeros(1, 500, 3)
    volume = occupancy(crowd, 8, 0.5, torch.tensor([1.0]))
    assert 0 <= volume.min() < volume.max() <= 1


@pytest.mark.parametrize("turned", [0.25, -0.25])
def test_the_gradient_of_a_pose_points_back(turned):
    """A bar seen from the side, turned in the image plane: descent turns it back."""
    bar = torch.zeros(1, 60, 3, dtype=torch.float64)
    bar[0, :, 0] = torch.linspace(-0.35, 0.35, 60, dtype=torch.float64)
    target = project(bar, 16, 1.0).silhouette
    angle = torch.tensor(turned, dtype=torch.float64, requires_grad=True)
    image = project(bar @ rotation_z(angle).mT, 16, 1.0)
    (image.silhouette - target).square().sum().backward()
    assert angle.grad is not None
    assert angle.grad * turned > 0
