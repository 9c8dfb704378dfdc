# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rays beside an object as points with a kind, so that a point network can see them."""

import torch
from jaxtyping import Float
from torch import Tensor

KINDS = 3
"""A ray went on beyond the object, was ended before it, or ended near it."""
_LEAST_M = 0.1


def ray_points(
    ends: Float[Tensor, "m 3"],
    centre: Float[Tensor, "3"],
    count: int,
    *,
    depth_m: float,
    within_m: float,
    starts: Float[Tensor, "m 3"] | None = None,
) -> Float[Tensor, "count 6"]:
    """Where rays pass an object, about its centre, and what became of each.

    A ray that ended within `depth_m` of the centre's distance is the point where it ended. Any
    other is the point where it passes the centre nearest. Rays that pass farther away are left out.

    Args:
        ends: of rays that came back, metres, in the frame of `centre`.
        centre: of the object's scan, metres.
        count: points returned; of more rays every so many-th is taken.
        depth_m: how far before or behind the centre a ray ends that is said to have been stopped
            there, or to have gone on.
        within_m: how far from the centre a point may lie.
        starts: of the rays, metres; None: all at the origin.

    Returns:
        A row `x, y, z, beyond, before, near` each, of which one of the last three is 1; rows of
        zeros where there are fewer rays.
    """
    found = ends.new_zeros(count, 3 + KINDS)
    starts = torch.zeros_like(ends) if starts is None else starts
    ranges = (ends - starts).norm(dim=-1).clamp_min(_LEAST_M)
    directions = (ends - starts) / ranges[:, None]
    depth = ((centre - starts) * directions).sum(-1)
    beyond, before = ranges > depth + depth_m, ranges < depth - depth_m
    passing = starts + depth.clamp_min(_LEAST_M)[:, None] * directions
    at = torch.where((beyond | before)[:, None], passing, ends) - centre
    rows = torch.nonzero(at.norm(dim=-1) < within_m)[:, 0]
    if len(rows) > count:
        rows = rows[torch.arange(count, device=rows.device) * len(rows) // count]
    kinds = torch.stack((beyond, before, ~(beyond | before)), dim=-1)
    found[: len(rows)] = torch.cat((at, kinds.to(at.dtype)), dim=-1)[rows]
    return found
