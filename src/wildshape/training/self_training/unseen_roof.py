# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Roofs that are higher than any sensor of the track (beyond the paper).

From below, nothing is seen of the roof of a van or a lorry but its edges. Between the edges of each
slice across the object a flat roof is put, and what a sensor would have seen of it, had it been
there, is taken away again. Where the side itself ends with the sensor's view, so that nobody knows
how high it goes, there is no roof.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.field_of_view import highest_seen
from wildshape.geometry.projection.visibility import FacingBins, facing_bins

_SLICE, _EDGE, _STEP, _MEASURED = 0.2, 0.2, 0.15, 0.25
_FEWEST, _ENDS, _TOP = 4, 0.02, 0.97
_CELL, _BEHIND, _OFTEN = FacingBins(0.25), 0.1, 0.2
_CUT_M = 0.3


def unseen_roof(
    shape: Float[Tensor, "G 3"],
    sensors: Float[Tensor, "O 3"],
    view_top: float = math.inf,
    *,
    mirror: bool,
) -> Float[Tensor, "R 3"]:
    """Points of the flat roof that hardly a sensor could see; none if it was seen.

    Args:
        shape: what a track's scans saw together, canonical frame (z up), metres.
        sensors: places from which it was seen, the same frame.
        view_top: slope above which the sensors saw nothing (`field_of_view.py`).
        mirror: what was seen of one side of y = 0 is known of the other.
    """
    flat = _flat_roof(shape)
    flat = flat[flat[:, 2] < highest_seen(flat[:, :2], sensors, view_top) - _CUT_M]
    if len(flat) > 0:
        flat = flat[torch.cdist(flat, shape).amin(1) > _MEASURED]
    if len(flat) == 0:
        return flat
    sides = (1.0, -1.0) if mirror else (1.0,)
    places = [place * place.new_tensor((1.0, side, 1.0)) for place in sensors for side in sides]
    seen = torch.stack([~_hidden(flat - place, shape - place) for place in places])
    return flat[seen.float().mean(0) <= _OFTEN]


def _hidden(points: Float[Tensor, "R 3"], shape: Float[Tensor, "G 3"]) -> Bool[Tensor, "R"]:
    """Which points have some of the shape in front of them, both relative to the sensor."""
    rays = torch.cat((shape, points))[None]
    bins = facing_bins(rays, shape.mean(0)[None], _CELL)
    index, depth = bins.index[0], bins.depth[0]
    nearest = torch.full((bins.count,), torch.inf)
    nearest.scatter_reduce_(0, index[: len(shape)], depth[: len(shape)], "amin")
    return nearest[index[len(shape) :]] < depth[len(shape) :] - _BEHIND


def _flat_roof(shape: Float[Tensor, "G 3"]) -> Float[Tensor, "R 3"]:
    """A grid between the upper edges of each slice along x."""
    low, high = shape[:, 0].quantile(_ENDS), shape[:, 0].quantile(1 - _ENDS)
    rows = [
        _across(shape[(shape[:, 0] - middle).abs() <= _SLICE / 2], middle)
        for middle in torch.arange(float(low), float(high), _SLICE)
    ]
    return torch.cat(rows) if rows else shape[:0]


def _across(points: Float[Tensor, "n 3"], middle: Tensor) -> Float[Tensor, "r 3"]:
    """Points from edge to edge at the height of one slice's top."""
    if len(points) < _FEWEST:
        return points[:0]
    top = points[:, 2].quantile(_TOP)
    edge = points[points[:, 2] > top - _EDGE, 1]
    y = torch.arange(float(edge.min()), float(edge.max()) + _STEP / 2, _STEP)
    return torch.stack((middle.expand(len(y)), y, top.expand(len(y))), dim=1)
