# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The features that a completion's probabilities are made from (`method/trust.py`)."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.geometry.box import box_axes
from wildshape.geometry.projection.sight_lines import Standing
from wildshape.geometry.sampling import drawn, quantiles
from wildshape.geometry.surface import moments, thinnest_axis
from wildshape.geometry.transforms.se3 import SE3
from wildshape.method.confidence import SMALLEST_M, ConfidenceFeatures
from wildshape.method.network import Poses
from wildshape.method.trust import (
    BENT,
    DEEP_M,
    FAR_M,
    PATCH_POINTS,
    RIVAL_DEG,
    SURFACE_POINTS,
    ScanFeatures,
    Surface,
    TrackFeatures,
    size_off,
)
from wildshape.ops.nearest import nearest_k
from wildshape.records import Completion, Points

_OUTERMOST, _ALIKE_DEG, _MOST_POINTS = 0.02, 3.0, 500
_THICKER, _LEAST_THICK_M, _TINY = 0.9, 1e-3, 1e-6


def rival_margin(poses: Poses, believed: Float[Tensor, "B H"]) -> Float[Tensor, "B 1"]:
    """By how much the best hypothesis of another heading costs more than the chosen one, metres.

    Args:
        poses: the hypotheses.
        believed: what decides between them, metres; the least speaks.
    """
    ahead = poses.rotation[..., 0]
    least, best = believed.min(-1, keepdim=True)
    chosen = ahead.gather(1, best[..., None].expand(-1, -1, 3))
    alike = (ahead * chosen).sum(-1) > math.cos(math.radians(RIVAL_DEG))
    behind = (believed - least).clamp_max(FAR_M)
    return torch.where(alike, FAR_M, behind).amin(-1, keepdim=True)


def surfaces(scans: Sequence[Points], R_sensor_canonical: Float[Tensor, "B 3 3"]) -> list[Surface]:
    """What the surfaces of scans are like: walls are flatter than a vehicle, leaves rougher.

    Args:
        scans: in a fixed order, at least `PATCH_POINTS` each.
        R_sensor_canonical: of their poses.
    """
    some = [scan[drawn(len(scan), min(len(scan), SURFACE_POINTS))] for scan in scans]
    points = torch.zeros(len(some), SURFACE_POINTS, 3, dtype=torch.float32)
    for row, part in zip(points, some):
        row[: len(part)] = torch.from_numpy(part)
    sizes = torch.tensor([len(part) for part in some])
    around = nearest_k(points, points, PATCH_POINTS, sizes, sizes).index
    spread = moments(points, around)[1].double()
    normal = thinnest_axis(spread)
    thin = _across(spread, normal)
    share = thin / (spread[0] + spread[3] + spread[5]).clamp_min(_TINY)
    used = torch.arange(SURFACE_POINTS) < sizes[:, None]
    thick = (thin / PATCH_POINTS).sqrt().masked_fill(~used, math.nan)
    rough = thick.nanquantile(_THICKER, dim=1).clamp_min(_LEAST_THICK_M).log()
    square = _mean(_square(normal @ R_sensor_canonical.double()), used)
    bent = _mean(((share > BENT[0]) & (share < BENT[1])).double(), used)
    return [Surface(*row) for row in torch.stack((square, rough, bent), dim=-1).tolist()]


def _across(spread: Float[Tensor, "6 B n"], normal: Float[Tensor, "B n 3"]) -> Tensor:
    """What of neighbourhoods' `moments` lies along their normals."""
    xx, xy, xz, yy, yz, zz = spread
    x, y, z = normal.unbind(-1)
    found = x * (xx * x + 2 * (xy * y + xz * z)) + y * (yy * y + 2 * yz * z) + zz * z * z
    return found.clamp_min(0)


def _square(normal: Float[Tensor, "B n 3"]) -> Float[Tensor, "B n"]:
    ahead, aside, _ = normal.square().unbind(-1)
    return (ahead.square() + aside.square()) / (ahead + aside).clamp_min(_TINY).square()


def _mean(values: Float[Tensor, "B n"], used: Bool[Tensor, "B n"]) -> Float[Tensor, "B"]:
    return (values * used).sum(1) / used.sum(1)


def scan_features(
    done: Completion,
    scan: Points,
    surface: Surface,
    rival: float,
    standing: Standing | None,
) -> ScanFeatures:
    """All features of one completion.

    Args:
        done: with its pose refined.
        scan: without the ground, sensor frame, metres.
        surface: of it.
        rival: see `rival_margin`.
        standing: what rays say of the shape's points, if any are known.
    """
    known, box = ConfidenceFeatures(*done.features), done.box
    half = np.maximum(box.size, SMALLEST_M) / 2
    inside = (scan - np.asarray(box.centre)) @ box_axes(box.quaternion_wxyz)
    low, high = quantiles(inside.T, (_OUTERMOST, 1 - _OUTERMOST))
    seen_length, seen_width, _ = ((high - low) / (2 * half)).tolist()
    return ScanFeatures(
        log_cost=known.log_cost,
        rival=rival,
        entropy=known.entropy,
        log_points=known.log_points,
        log_range=known.log_range,
        seen_length=seen_length,
        seen_width=seen_width,
        deep=float((np.abs(inside) < half - DEEP_M).all(1).mean()),
        log_length=math.log(max(box.size[0], SMALLEST_M)),
        size_off=size_off(box.size),
        free=math.nan if standing is None else float(standing.free.mean()),
        square=surface.square,
        rough=surface.rough,
        bent=surface.bent,
    )


def track_features(
    done: Sequence[Completion],
    rows: Int64[Tensor, "U"],
    T_sensor_object: SE3,
    size: tuple[float, float, float],
    cost: Float[Tensor, "V"],
) -> list[TrackFeatures]:
    """All features of a track, a record a scan.

    Args:
        done: scans completed each on its own, with their features; all, or of a long track some.
        rows: which scans these are.
        T_sensor_object: of every scan, the track's poses.
        size: of the track's box, metres.
        cost: label-free, of the track's shape in every scan, metres.
    """
    own = [ScanFeatures(*item.evidence) for item in done]
    points = np.exp([one.log_points for one in own])
    weights = np.sqrt(np.minimum(points, _MOST_POINTS))
    costs = np.log(np.maximum(cost.numpy(), SMALLEST_M))

    def mean_of(name: str) -> float:
        return float(np.average([getattr(one, name) for one in own], weights=weights))

    together = TrackFeatures(
        scan_cost=0.0,
        rival=mean_of("rival"),
        square=mean_of("square"),
        rough=mean_of("rough"),
        bent=mean_of("bent"),
        own_off=mean_of("size_off"),
        length_spread=float(np.std([one.log_length for one in own])),
        log_points=max(one.log_points for one in own),
        log_range=mean_of("log_range"),
        log_apart=math.log(views_apart(T_sensor_object[rows]) + _ALIKE_DEG),
        log_length=math.log(max(size[0], SMALLEST_M)),
        size_off=size_off(size),
    )
    return [together._replace(scan_cost=float(one)) for one in costs]


def views_apart(T_sensor_object: SE3) -> float:
    """How far apart the views of a track are, an angle at the object, degrees.

    The root mean square from the mean of the directions in which the sensor stands.
    """
    seen_from = torch.nn.functional.normalize(T_sensor_object.inverse().translation, dim=-1)
    middle = torch.nn.functional.normalize(seen_from.mean(0), dim=0)
    across = torch.linalg.cross(seen_from, middle.expand_as(seen_from)).norm(dim=-1)
    angles = torch.atan2(across, seen_from @ middle)
    return math.degrees(float(angles.square().mean().sqrt()))
