# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Roofs that are higher than any sensor of the track (beyond the paper).

From below, nothing is seen of the roof of a van or a truck but its edges. Between the edges of each
slice across the object a flat roof is put, and what a sensor would have seen of it, had it been
there, is taken away again. Where the side itself ends with the sensor's view, so that nobody knows
how high it goes, there is no roof.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.field_of_view import highest_seen
from wildshape.geometry.projection.visibility import FacingBins, facing_bins


@dataclass(frozen=True)
class RoofConfig:
    """Where a flat roof is put.

    Attributes:
        slice_m: breadth of the slices across the object.
        edge_m: points so far below a slice's top are its upper edges.
        step_m: distance of the roof's points across the object.
        measured_m: nearer than this to a point that was seen the roof is known.
        fewest: points of a slice that has edges.
        ends: share of the shape at either end that has no roof; there are strays.
        top: share of a slice's points that lie no higher than its top.
        cell_m: bins in which nearer points hide others.
        behind_m: a point is hidden by what lies so much nearer; both are measured with noise.
        often: largest share of the sensors that may have looked upon a point of the roof.
        cut_m: a side that ends nearer than this to the end of the view goes on, unknown how far.
    """

    slice_m: float = 0.2
    edge_m: float = 0.2
    step_m: float = 0.15
    measured_m: float = 0.25
    fewest: int = 4
    ends: float = 0.02
    top: float = 0.97
    cell_m: float = 0.25
    behind_m: float = 0.1
    often: float = 0.2
    cut_m: float = 0.3


_DEFAULT = RoofConfig()


def unseen_roof(
    shape: Float[Tensor, "G 3"],
    sensors: Float[Tensor, "O 3"],
    view_top: float = math.inf,
    config: RoofConfig = _DEFAULT,
    *,
    mirror: bool,
) -> Float[Tensor, "R 3"]:
    """Points of the flat roof that hardly a sensor could see; none if it was seen.

    Args:
        shape: what a track's scans saw together, canonical frame (z up), metres.
        sensors: places from which it was seen, the same frame.
        view_top: slope above which the sensors saw nothing (`field_of_view.py`).
        config: where it is put.
        mirror: what was seen of one side of y = 0 is known of the other.
    """
    flat = _flat_roof(shape, config)
    flat = flat[flat[:, 2] < highest_seen(flat[:, :2], sensors, view_top) - config.cut_m]
    if len(flat) > 0:
        flat = flat[torch.cdist(flat, shape).amin(1) > config.measured_m]
    if len(flat) == 0:
        return flat
    sides = (1.0, -1.0) if mirror else (1.0,)
    places = [place * place.new_tensor((1.0, side, 1.0)) for place in sensors for side in sides]
    seen = torch.stack([~_hidden(flat - place, shape - place, config) for place in places])
    return flat[seen.float().mean(0) <= config.often]


def _hidden(
    points: Float[Tensor, "R 3"], shape: Float[Tensor, "G 3"], config: RoofConfig
) -> Bool[Tensor, "R"]:
    """Which points have some of the shape in front of them, both relative to the sensor."""
    rays = torch.cat((shape, points))[None]
    bins = facing_bins(rays, shape.mean(0)[None], FacingBins(config.cell_m))
    index, depth = bins.index[0], bins.depth[0]
    nearest = torch.full((bins.count,), torch.inf)
    nearest.scatter_reduce_(0, index[: len(shape)], depth[: len(shape)], "amin")
    return nearest[index[len(shape) :]] < depth[len(shape) :] - config.behind_m


def _flat_roof(shape: Float[Tensor, "G 3"], config: RoofConfig) -> Float[Tensor, "R 3"]:
    """A grid between the upper edges of each slice along x."""
    low, high = shape[:, 0].quantile(config.ends), shape[:, 0].quantile(1 - config.ends)
    rows = [
        _across(shape[(shape[:, 0] - middle).abs() <= config.slice_m / 2], middle, config)
        for middle in torch.arange(float(low), float(high), config.slice_m)
    ]
    return torch.cat(rows) if rows else shape[:0]


def _across(
    points: Float[Tensor, "n 3"], middle: Tensor, config: RoofConfig
) -> Float[Tensor, "r 3"]:
    """Points from edge to edge at the height of one slice's top."""
    if len(points) < config.fewest:
        return points[:0]
    top = points[:, 2].quantile(config.top)
    edge = points[points[:, 2] > top - config.edge_m, 1]
    y = torch.arange(float(edge.min()), float(edge.max()) + config.step_m / 2, config.step_m)
    return torch.stack((middle.expand(len(y)), y, top.expand(len(y))), dim=1)
