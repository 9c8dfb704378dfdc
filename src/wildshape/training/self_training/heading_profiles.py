# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What objects look like from the side and from above, and which way round they are most alike.

Beyond the paper. Two vehicles turned the same way are more alike than turned against each other, if
they are of one kind; a lorry says little of a small car. So each object is compared with those
that are most like it either way round, and all agree by the signs of a leading eigenvector (Z2
synchronisation on a graph of neighbours).
"""

from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor

_BINS, _LEVELS, _FEWEST_OF_SLICE, _FEWEST_OF_CELL = 16, 6, 20, 5
_TOP, _SIDE, _ENDS = 0.95, 0.9, 0.01
_REFERENCES, _NEIGHBOURS, _EVERYBODY = 3000, 10, 0.01
# Unlike by so much for each metre that lengths and heights differ.
_LENGTH, _HEIGHT = 0.1, 0.2
_UNSEEN, _SMALLEST = 0.5, 1e-6


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


def profile(cloud: Float[Tensor, "n 3"]) -> Profiles:
    """The profile of one object, J = 1; strays at its ends do not count."""
    ends = cloud[:, (0, 2)].quantile(cloud.new_tensor((_ENDS, 1 - _ENDS)), dim=0)
    size = ends[1] - ends[0]
    place = (cloud[:, (0, 2)] - ends[0]) / size.clamp_min(_SMALLEST)
    inside = ((place >= 0) & (place <= 1)).all(1)
    place, x_y_z = place[inside], cloud[inside]
    slices = (place[:, 0] * _BINS).long().clamp_max(_BINS - 1)
    levels = (place[:, 1] * _LEVELS).long().clamp_max(_LEVELS - 1)
    tops = _upper(x_y_z[:, 2], slices, _BINS, _TOP, _FEWEST_OF_SLICE)
    cells = slices * _LEVELS + levels
    sides = _upper(x_y_z[:, 1].abs(), cells, _BINS * _LEVELS, _SIDE, _FEWEST_OF_CELL)
    tops = tops - tops.nanmean()
    return Profiles(tops[None], sides.view(1, _BINS, _LEVELS), size[None, 0], size[None, 1])


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


def agreed_signs(profiles: Profiles) -> Float[Tensor, "J"]:
    """+1 or -1 for each object: reverse those of -1 and all look one way.

    The first few thousand agree among each other; the rest follow those most like them.
    """
    known = Profiles(*(part[:_REFERENCES] for part in profiles))
    evidence = _evidence(profiles, known)
    among = evidence[: len(known.length)]
    among = (among + among.T) / 2
    degree = among.abs().sum(1).clamp_min(_SMALLEST).rsqrt()
    among = degree[:, None] * among * degree
    signs = torch.sign(torch.linalg.eigh(among).eigenvectors[:, -1])
    return torch.where(evidence @ signs < 0, -1.0, 1.0)


def _evidence(profiles: Profiles, known: Profiles) -> Float[Tensor, "J R"]:
    """How much better each fits its neighbours as it stands than reversed, -1 to 1 a neighbour.

    Objects that are no neighbours count too, though little: no group is left to itself.
    """
    every = torch.ones(len(known.length), dtype=torch.bool)
    as_is, turned = difference(profiles, known), difference(profiles, reversed_where(known, every))
    unlike = torch.minimum(as_is, turned)
    sizes = _sizes_apart(profiles, known)
    votes = (turned - as_is) / (turned + as_is - 2 * sizes).clamp_min(_SMALLEST)
    own = torch.arange(len(known.length))
    unlike[own, own] = torch.inf
    votes[own, own] = 0.0
    near = unlike.topk(min(_NEIGHBOURS, len(own)), largest=False).indices
    weight = torch.full_like(votes, _EVERYBODY / len(own)).scatter_(1, near, 1.0)
    return votes * weight


def reversed_where(profiles: Profiles, chosen: Bool[Tensor, "J"]) -> Profiles:
    """The same objects, those chosen turned by half a turn."""
    tops = torch.where(chosen[:, None], profiles.tops.flip(1), profiles.tops)
    sides = torch.where(chosen[:, None, None], profiles.sides.flip(1), profiles.sides)
    return profiles._replace(tops=tops, sides=sides)


def difference(a: Profiles, b: Profiles) -> Float[Tensor, "I J"]:
    """How unlike objects are as they stand: tops, sides, over what both have seen, and sizes."""
    rows = [
        _apart(tops, b.tops) + _apart(sides.flatten(), b.sides.flatten(1))
        for tops, sides in zip(a.tops, a.sides)
    ]
    return torch.stack(rows) + _sizes_apart(a, b)


def _sizes_apart(a: Profiles, b: Profiles) -> Float[Tensor, "I J"]:
    lengths = (a.length[:, None] - b.length).abs()
    return _LENGTH * lengths + _HEIGHT * (a.height[:, None] - b.height).abs()


def _apart(one: Float[Tensor, "m"], many: Float[Tensor, "J m"]) -> Float[Tensor, "J"]:
    return torch.nan_to_num((one - many).abs().nanmean(1), nan=_UNSEEN)
