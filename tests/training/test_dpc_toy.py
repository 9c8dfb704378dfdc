# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC's pose can be found: a known shape is turned back by descent on its images alone."""

import pytest
import torch

from wildshape.baselines.dpc.occupancy import project
from wildshape.baselines.dpc.silhouette import Rendering, hindsight
from wildshape.baselines.dpc.viewing_volume import (
    PinholeVolume,
    PolarVolume,
    ahead,
    place,
    to_volume,
)
from wildshape.geometry.transforms.rotation import (
    rotation_angle,
    rotation_from_quaternion,
    rotation_z,
)

SIZE = 16


def aeroplane():
    """Wings, body, fin: three thin boxes, unlike from every side; unit cube."""
    draw = torch.Generator().manual_seed(0)
    size = torch.tensor([[0.9, 0.1, 0.1], [0.15, 0.8, 0.04], [0.1, 0.03, 0.25]])
    middle = torch.tensor([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [-0.4, 0.0, 0.12]])
    boxes = (torch.rand(3, 150, 3, generator=draw) - 0.5) * size[:, None] + middle[:, None]
    return boxes.flatten(0, 1)


@pytest.mark.parametrize(
    ("volume", "distance", "depth"),
    [(PinholeVolume(), 2.0, 0.0), (PinholeVolume(), 2.0, 1.0), (PolarVolume(), 12.0, 1.0)],
)
def test_the_nearest_of_four_headings_is_turned_into_the_pose(volume, distance, depth):
    shape, offset = aeroplane(), torch.tensor([distance])
    tilt = rotation_from_quaternion(torch.tensor([0.9, 0.35, 0.2, 0.1]))
    truth = tilt @ rotation_z(torch.tensor(0.5))
    middle = ahead(offset, volume)
    seen = to_volume(place(shape, truth[None], middle, volume), offset, volume)
    ones = torch.ones(1)
    # 17 degrees off in heading, for the nearest.
    starts = tilt @ rotation_z(torch.tensor([0.8, 2.37, 3.94, 5.51]))
    turn = torch.zeros(4, 3, requires_grad=True)
    optimiser = torch.optim.Adam([turn], lr=0.03)

    def turned():
        return rotation_from_quaternion(torch.cat((torch.ones(4, 1), turn), dim=1)) @ starts

    winners = []
    for sigma in torch.linspace(1.0, 0.5, 25).tolist():
        posed = place(shape, turned()[None], middle[:, None], volume)
        image = project(seen, SIZE, sigma, ones)
        found = hindsight(posed, offset, image, Rendering(volume, SIZE, sigma, depth), ones)
        optimiser.zero_grad()
        found.loss.backward()
        optimiser.step()
        winners.append(int(found.winner))
    error = torch.rad2deg(rotation_angle(turned().detach()[winners[-1]].mT @ truth))
    assert set(winners) == {0}
    assert error < 8


def test_a_translation_is_found_by_descent():
    """DPC-dagger's part: the pose is known, the object is moved by up to a tenth of the cube."""
    shape, offset, volume = aeroplane(), torch.tensor([2.0]), PinholeVolume()
    tilt = rotation_from_quaternion(torch.tensor([[0.9, 0.35, 0.2, 0.1]]))
    truth, middle, ones = torch.tensor([[0.08, -0.05, 0.1]]), ahead(offset, volume), torch.ones(1)
    moved = torch.zeros(1, 3, requires_grad=True)
    optimiser = torch.optim.Adam([moved], lr=0.01)
    rendering = Rendering(volume, SIZE, 1.0, 1.0)
    seen = to_volume(place(shape, tilt, middle + truth, volume), offset, volume)
    image = project(seen, SIZE, rendering.sigma, ones)
    for _ in range(50):
        posed = place(shape, tilt, middle + moved, volume)[:, None]
        optimiser.zero_grad()
        hindsight(posed, offset, image, rendering, ones).loss.backward()
        optimiser.step()
    assert (moved - truth).norm() < 0.02
