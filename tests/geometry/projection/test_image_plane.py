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
    """Each point may slide along the direction of view, which is that to the centre."""
    centre = torch.tensor([[0.0, 0.0, 9.0]], dtype=torch.float64)
    points = clouds(1, 1, 20, 3)
    slid = points + torch.linspace(-3, 3, 20).double()[:, None] * centre / 9
    moved = compared(slid, centre, projection)
    torch.testing.assert_close(moved, compared(points, centre, projection))
    assert not moved[..., 2].any()


@pytest.mark.parametrize("projection", IN_THE_IMAGE)
def test_what_is_farther_away_is_not_smaller(projection):
    """A shape of twice the size at twice the distance does not look alike: its size is held."""
    points = clouds(3, 1, 20, 3)
    seen, twice = (compared(size * points, CENTRE, projection) for size in (1, 2))
    torch.testing.assert_close(twice, 2 * seen)


@pytest.mark.parametrize("projection", IN_THE_IMAGE)
def test_lengths_across_the_line_of_sight_are_kept(projection):
    """Metres stay metres."""
    centre = torch.tensor([[0.0, 0.0, 9.0]], dtype=torch.float64)
    step = torch.tensor([[[0.0, 0.0, 0.0], [1.2, 0.9, 0.0]]], dtype=torch.float64)
    seen = compared(step, centre, projection)
    assert float((seen[0, 1] - seen[0, 0]).norm()) == pytest.approx(1.5)


def test_a_lidar_has_no_seam():
    """A turn about the vertical turns scan and image alike: nothing else changes."""
    points, centre = clouds(2, 1, 20, 3), torch.tensor([[8.0, 1.0, -1.0]], dtype=torch.float64)
    plain = compared(points, centre, FacingBins(flat=True))
    turn = rotation_z(torch.tensor([3.0]).double())
    turned = compared(points @ turn.mT, (turn @ centre[..., None])[..., 0], FacingBins(flat=True))
    torch.testing.assert_close(turned, plain)
