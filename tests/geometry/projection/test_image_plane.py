# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Losses on 2D projections: what they no longer see, and what they do."""

import pytest
import torch
from tests.strategies import clouds

from wildshape.geometry.projection.image_plane import compared
from wildshape.geometry.projection.visibility import FacingBins, PixelBins, PolarBins
from wildshape.geometry.transforms.rotation import rotation_z

IN_THE_IMAGE = [PolarBins(flat=True), FacingBins(flat=True), PixelBins(flat=True)]
CENTRE = torch.tensor([[0.4, -0.3, 9.0]], dtype=torch.float64)


@pytest.mark.parametrize("projection", [PolarBins(), FacingBins(), PixelBins()])
def test_without_it_points_are_as_they_are(projection):
    points = clouds(0, 1, 20, 3)
    assert compared(points, CENTRE, projection) is points


@pytest.mark.parametrize("projection", IN_THE_IMAGE)
def test_how_far_away_a_point_is_does_not_count(projection):
    """Each point may slide along its ray."""
    points = clouds(1, 1, 20, 3)
    stretched = (points + CENTRE[:, None]) * torch.linspace(0.5, 3, 20).double()[:, None]
    moved = compared(stretched - CENTRE[:, None], CENTRE, projection)
    torch.testing.assert_close(moved, compared(points, CENTRE, projection))
    assert not moved[..., 2].any()


@pytest.mark.parametrize("projection", IN_THE_IMAGE)
def test_lengths_across_the_line_of_sight_are_kept(projection):
    """Small ones, at the centre: metres stay metres."""
    across = torch.linalg.cross(CENTRE, torch.tensor([[0.0, 1.0, 0.0]]).double())
    step = 0.01 * torch.stack((torch.zeros(1, 3).double(), across / across.norm()), dim=1)
    seen = compared(step, CENTRE, projection)
    assert float((seen[0, 1] - seen[0, 0]).norm()) == pytest.approx(0.01, rel=0.01)


def test_a_lidar_has_no_seam():
    """A turn about the vertical turns scan and image alike: nothing else changes."""
    points, centre = clouds(2, 1, 20, 3), torch.tensor([[8.0, 1.0, -1.0]], dtype=torch.float64)
    plain = compared(points, centre, FacingBins(flat=True))
    turn = rotation_z(torch.tensor([3.0]).double())
    turned = compared(points @ turn.mT, (turn @ centre[..., None])[..., 0], FacingBins(flat=True))
    torch.testing.assert_close(turned, plain)


def test_points_behind_a_camera_are_finite_and_far_from_the_image():
    points = torch.tensor([[[0.5, 0.0, -20.0], [0.5, 0.0, -9.0]]], dtype=torch.float64)
    seen = compared(points, CENTRE, PixelBins(flat=True))
    assert bool(seen.isfinite().all())
    assert float(seen[0, 0, 0]) == pytest.approx(9.0)
