# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A roof no sensor could see is closed; where one could have seen, nothing is invented."""

import torch

from wildshape.training.self_training.unseen_roof import unseen_roof


def _walls(height: float) -> torch.Tensor:
    """Two long walls and two short ones, 8 m by 2 m, without a roof."""
    x, z = torch.meshgrid(torch.arange(-4, 4.05, 0.1), torch.arange(0, height, 0.1), indexing="ij")
    x, z = x.flatten(), z.flatten()
    sides = [torch.stack((x, torch.full_like(x, y), z), 1) for y in (-1.0, 1.0)]
    y, z = torch.meshgrid(torch.arange(-1, 1.05, 0.1), torch.arange(0, height, 0.1), indexing="ij")
    y, z = y.flatten(), z.flatten()
    ends = [torch.stack((torch.full_like(y, x), y, z), 1) for x in (-4.0, 4.0)]
    return torch.cat((*sides, *ends))


_LOW = torch.tensor(((12.0, 8.0, 1.7), (0.0, 10.0, 1.7), (-9.0, 9.0, 1.7)))


def test_a_high_roof_is_closed_at_the_height_of_its_edges():
    roof = unseen_roof(_walls(3.0), _LOW, mirror=True)
    assert len(roof) > 200
    assert torch.allclose(roof[:, 2], torch.tensor(2.9), atol=0.15)
    assert float(roof[:, 0].abs().max()) < 4.1
    assert float(roof[:, 1].abs().max()) < 1.0
    assert float(roof[:, 1].abs().min()) < 0.15  # the middle too


def test_what_a_sensor_looked_down_upon_stays_open():
    above = torch.tensor(((12.0, 8.0, 7.0), (0.0, 10.0, 7.0)))
    assert len(unseen_roof(_walls(1.0), above, mirror=True)) < 10


def test_a_roof_that_was_measured_is_left_as_it_is():
    x, y = torch.meshgrid(torch.arange(-4, 4.05, 0.1), torch.arange(-1, 1.05, 0.1), indexing="ij")
    top = torch.stack((x.flatten(), y.flatten(), torch.full((x.numel(),), 2.9)), 1)
    assert len(unseen_roof(torch.cat((_walls(3.0), top)), _LOW, mirror=True)) == 0


def test_a_side_that_ends_with_the_view_has_no_roof():
    """From 16 m, a view that ends at 4.6 degrees sees 3 m: the walls may well be higher."""
    assert len(unseen_roof(_walls(3.0), _LOW, 0.08, mirror=True)) == 0
    assert len(unseen_roof(_walls(2.0), _LOW, 0.08, mirror=True)) > 200


def test_what_was_seen_of_one_side_is_known_of_the_other_where_objects_are_symmetric():
    """A sensor a little above the roof sees its far half; the near half lies behind the edge."""
    place = torch.tensor(((0.0, 6.0, 4.0),))
    near = unseen_roof(_walls(3.0), place, mirror=False)
    assert len(near) > 80
    assert float(near[:, 1].mean()) > 0.2
    assert len(unseen_roof(_walls(3.0), place, mirror=True)) < 40


def test_a_roof_is_as_broad_as_the_top_and_has_none_of_the_strays():
    """Above broad walls the upper part is narrower; a handful of points flies far behind."""
    upper = _walls(1.0) * torch.tensor((1.0, 0.6, 1.0)) + torch.tensor((0.0, 0.0, 2.1))
    strays = torch.tensor((-9.0, 0.0, 0.0)) + torch.arange(6)[:, None] * torch.tensor((0, 0.1, 0.4))
    roof = unseen_roof(torch.cat((_walls(2.0), upper, strays)), _LOW, mirror=True)
    assert len(roof) > 100
    assert float(roof[:, 1].abs().max()) < 0.7
    assert float(roof[:, 0].min()) > -4.2
