# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What objects look like from the side and from above, and which way round they are most alike.

Beyond the paper. Two vehicles turned the same way are more alike than turned against each other, if
they are of one kind; a truck says little of a small car. So each object is compared with those
that are most like it either way round, and all agree by the signs of a leading eigenvector (Z2
synchronisation on a graph of neighbours).
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

_SMALLEST = 1e-6
_ROWS = 64  # of differences at a time: memory does not grow with the square of the tracks


@dataclass(frozen=True)
class ProfileConfig:
    """What a profile is made of, and how unlike two of them are.

    Attributes:
        slices: along the object.
        levels: heights at which the breadth of each slice is taken.
        fewest_of_slice: with fewer points the top of a slice is not known.
        fewest_of_cell: with fewer points the breadth of a slice at a level is not known.
        top: share of a slice's points that lie no higher than its top; few fly above a roof.
        side: share of a cell's points that lie no further out than its side.
        ends: share of the points at either end that do not count; scans have strays.
        references: objects that agree among each other; the cost grows with the square.
        neighbours: most alike objects, which vote with weight 1.
        everybody: weight of all others together, so that no kind is left to itself.
        length: metres of unlikeness for each metre that lengths differ.
        height: the same of heights, which differ less within a kind.
        unseen_m: unlikeness where the two saw nothing in common.
    """

    slices: int = 16
    levels: int = 6
    fewest_of_slice: int = 20
    fewest_of_cell: int = 5
    top: float = 0.95
    side: float = 0.9
    ends: float = 0.01
    references: int = 3000
    neighbours: int = 10
    everybody: float = 0.01
    length: float = 0.1
    height: float = 0.2
    unseen_m: float = 0.5


_DEFAULT = ProfileConfig()


class Profiles(NamedTuple):
    """Objects in their canonical frames; metres.

    Attributes:
        tops: height of each slice along x, about the mean of the slices; NaN where hardly seen.
        sides: half the breadth of each slice at each of some heights; NaN where hardly seen.
        length: along x.
        height: along z.
    """

    tops: Float[Tensor, "J bins"]
    sides: Float[Tensor, "J bins levels"]
    length: Float[Tensor, "J"]
    height: Float[Tensor, "J"]


def profile(cloud: Float[Tensor, "n 3"], config: ProfileConfig = _DEFAULT) -> Profiles:
    """The profile of one object, J = 1; strays at its ends do not count."""
    slices, levels = config.slices, config.levels
    ends = cloud[:, (0, 2)].quantile(cloud.new_tensor((config.ends, 1 - config.ends)), dim=0)
    size = ends[1] - ends[0]
    place = (cloud[:, (0, 2)] - ends[0]) / size.clamp_min(_SMALLEST)
    inside = ((place >= 0) & (place <= 1)).all(1)
    place, x_y_z = place[inside], cloud[inside]
    of_slice = (place[:, 0] * slices).long().clamp_max(slices - 1)
    of_level = (place[:, 1] * levels).long().clamp_max(levels - 1)
    tops = _upper(x_y_z[:, 2], of_slice, slices, config.top, config.fewest_of_slice)
    cells, across = of_slice * levels + of_level, x_y_z[:, 1].abs()
    sides = _upper(across, cells, slices * levels, config.side, config.fewest_of_cell)
    tops = tops - tops.nanmean()
    return Profiles(tops[None], sides.view(1, slices, levels), size[None, 0], size[None, 1])


def _upper(
    values: Float[Tensor, "n"], cell: Tensor, cells: int, share: float, fewest: int
) -> Float[Tensor, "cells"]:
    """The value in each cell that this share of its values does not exceed; NaN of few."""
    order = values.argsort()
    order = order[cell[order].argsort(stable=True)]
    count = torch.bincount(cell, minlength=cells)
    place = count.cumsum(0) - count + ((count - 1).clamp_min(0) * share).long()
    found = values[order][place.clamp_max(len(values) - 1)]
    return torch.where(count >= fewest, found, torch.nan)


def together(profiles: list[Profiles]) -> Profiles:
    """Many as one."""
    return Profiles(*(torch.cat(parts) for parts in zip(*profiles)))


def agreed_signs(profiles: Profiles, config: ProfileConfig = _DEFAULT) -> Float[Tensor, "J"]:
    """+1 or -1 for each object: reverse those of -1 and all look one way.

    The first few thousand agree among each other; the rest follow those most like them.
    """
    known = Profiles(*(part[: config.references] for part in profiles))
    evidence = _evidence(profiles, known, config)
    among = evidence[: len(known.length)]
    among = (among + among.T) / 2
    degree = among.abs().sum(1).clamp_min(_SMALLEST).rsqrt()
    among = degree[:, None] * among * degree
    signs = torch.sign(torch.linalg.eigh(among).eigenvectors[:, -1])
    return torch.where(evidence @ signs < 0, -1.0, 1.0)


def _evidence(profiles: Profiles, known: Profiles, config: ProfileConfig) -> Float[Tensor, "J R"]:
    """How much better each fits its neighbours as it stands than reversed, -1 to 1 a neighbour.

    Objects that are no neighbours count too, though little: no group is left to itself.
    """
    every = torch.ones(len(known.length), dtype=torch.bool)
    as_is = difference(profiles, known, config)
    turned = difference(profiles, reversed_where(known, every), config)
    unlike = torch.minimum(as_is, turned)
    sizes = _sizes_apart(profiles, known, config)
    votes = (turned - as_is) / (turned + as_is - 2 * sizes).clamp_min(_SMALLEST)
    own = torch.arange(len(known.length))
    unlike[own, own] = torch.inf
    votes[own, own] = 0.0
    near = unlike.topk(min(config.neighbours, len(own)), largest=False).indices
    weight = torch.full_like(votes, config.everybody / len(own)).scatter_(1, near, 1.0)
    return votes * weight


def reversed_where(profiles: Profiles, chosen: Bool[Tensor, "J"]) -> Profiles:
    """The same objects, those chosen turned by half a turn."""
    tops = torch.where(chosen[:, None], profiles.tops.flip(1), profiles.tops)
    sides = torch.where(chosen[:, None, None], profiles.sides.flip(1), profiles.sides)
    return profiles._replace(tops=tops, sides=sides)


def difference(a: Profiles, b: Profiles, config: ProfileConfig = _DEFAULT) -> Float[Tensor, "I J"]:
    """How unlike objects are as they stand: tops, sides, over what both have seen, and sizes."""
    unseen = config.unseen_m
    found = _sizes_apart(a, b, config)
    for row, tops, sides in zip(found, a.tops, a.sides):
        row += _apart(tops, b.tops, unseen) + _apart(sides.flatten(), b.sides.flatten(1), unseen)
    return found


def nearest_profiles(
    profiles: Profiles, count: int, config: ProfileConfig = _DEFAULT
) -> Int64[Tensor, "J k"]:
    """The least unlike of each object, itself among them; some rows of `difference` at a time."""
    parts = zip(*(part.split(_ROWS) for part in profiles))
    least = min(count, len(profiles.length))
    rows = (difference(Profiles(*part), profiles, config) for part in parts)
    return torch.cat([unlike.topk(least, largest=False).indices for unlike in rows])


def _sizes_apart(a: Profiles, b: Profiles, config: ProfileConfig) -> Float[Tensor, "I J"]:
    lengths = (a.length[:, None] - b.length).abs()
    return config.length * lengths + config.height * (a.height[:, None] - b.height).abs()


def _apart(
    one: Float[Tensor, "m"], many: Float[Tensor, "J m"], unseen: float
) -> Float[Tensor, "J"]:
    return torch.nan_to_num((one - many).abs().nanmean(1), nan=unseen)
