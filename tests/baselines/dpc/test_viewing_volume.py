# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The cube before a sensor: where points land, and the images of scans."""

import pytest
import torch

from wildshape.baselines.dpc.viewing_volume import (
    PinholeVolume,
    PolarVolume,
    ahead,
    beyond,
    coarser,
    offsets,
    place,
    scan_image,
    to_volume,
    upwards,
)
from wildshape.geometry.transforms.rotation import rotation_z

CAMERA, LIDAR = PinholeVolume(), PolarVolume()


def test_the_object_s_origin_is_the_middle_of_the_cube():
    for volume, distance in ((CAMERA, 2.0), (LIDAR, 14.0)):
        offset = torch.tensor([distance])
        at = to_volume(ahead(offset, volume)[:, None], offset, volume)
        torch.testing.assert_close(at, torch.zeros(1, 1, 3))


def test_a_pinhole_image_is_that_of_its_intrinsics():
    point = torch.tensor([[[0.3, -0.2, 2.4]]])
    right, down, away = to_volume(point, torch.tensor([2.0]), CAMERA)[0, 0].tolist()
    assert right == pytest.approx(1.875 * 0.3 / 2.4)
    assert down == pytest.approx(-1.875 * 0.2 / 2.4)
    assert away == pytest.approx(0.4)


def test_a_lidar_s_rays_are_lines_of_the_cube():
    """Along one ray neither pixel coordinate changes, and depth counts in edges of the cube."""
    ray = torch.tensor([0.97, 0.2, -0.14])
    ray = ray / ray.norm()
    points = torch.tensor([9.0, 10.0, 12.5])[:, None] * ray
    found = to_volume(points[None], torch.tensor([10.0]), LIDAR)[0]
    torch.testing.assert_close(found[:, :2], found[:1, :2].expand(3, 2))
    torch.testing.assert_close(found[:, 2], torch.tensor([-1.0, 0.0, 2.5]) / 6)
    assert found[0, 0] < 0 < found[0, 1]  # y is left, z is up; the image counts right and down


def test_a_pixel_of_a_lidar_image_is_as_wide_near_as_far():
    across = [
        to_volume(torch.tensor([[[r, 0.3, 0.0]]]), torch.tensor([r]), LIDAR)[0, 0, 0].item()
        for r in (8.0, 40.0)
    ]
    assert across == pytest.approx([-0.05, -0.05], rel=1e-2)


def test_up_is_up_in_the_image():
    for volume, distance in ((CAMERA, 2.0), (LIDAR, 14.0)):
        offset = torch.tensor([distance])
        above = ahead(offset, volume) + 0.1 * upwards(volume, offset)
        right, down, _ = to_volume(above[:, None], offset, volume)[0, 0].tolist()
        assert right == pytest.approx(0, abs=1e-6)
        assert down < -0.01


def test_what_is_told_of_the_distance():
    centre = torch.tensor([[0.1, 0.2, 1.7], [3.0, 4.0, 0.0]])
    assert offsets(centre, CAMERA).tolist() == [2.0, 2.0]
    assert offsets(centre, LIDAR)[1].item() == pytest.approx(5.0)


def test_points_are_scaled_turned_and_moved():
    quarter = rotation_z(torch.tensor(torch.pi / 2))
    found = place(torch.tensor([[0.5, 0.0, 0.0]]), quarter, torch.tensor([7.0, 0.0, 1.0]), LIDAR)
    torch.testing.assert_close(found, torch.tensor([[7.0, 3.0, 1.0]]))


def test_the_nearest_point_of_a_pixel_is_seen_and_strays_are_not():
    points = torch.tensor([[[-0.49, -0.49, 0.3], [-0.48, -0.48, -0.2], [0.1, 0.3, 0.1],
                            [0.6, 0.0, 0.0], [0.0, 0.0, 0.7]]])  # fmt: skip
    image = scan_image(points, 8)
    assert image.silhouette[0].nonzero().tolist() == [[0, 0], [6, 4]]  # row (down), column (right)
    assert image.depth[0, 0, 0].item() == pytest.approx(-0.2)
    assert image.depth[0, 3, 3].item() == pytest.approx(beyond(8))


def test_a_coarser_image_averages():
    image = scan_image(torch.tensor([[[-0.49, -0.49, 0.0], [-0.3, -0.49, 0.2]]]), 8)
    half = coarser(image, 4)
    assert (
        half.silhouette[0, 0].tolist() == [0.5 / 2, 0.5 / 2, 0, 0] or half.silhouette.sum() == 0.5
    )
    assert half.depth[0, 3, 3].item() == pytest.approx(beyond(4))
    assert coarser(image, 8).silhouette.equal(image.silhouette)
