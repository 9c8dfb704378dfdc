# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The features that a completion's probabilities are made from (`method/trust.py`)."""

import math
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.box import box_axes
from wildshape.geometry.projection.sight_lines import Standing
from wildshape.geometry.sampling import quantiles
from wildshape.geometry.transforms.rotation import rotation_angle
from wildshape.geometry.transforms.se3 import SE3
from wildshape.method.confidence import SMALLEST_M, ConfidenceFeatures
from wildshape.method.network import Poses
from wildshape.method.trust import (
    DEEP_M,
    FAR_M,
    RIVAL_DEG,
    ScanFeatures,
    TrackFeatures,
    size_off,
)
from wildshape.records import Completion, Points

_OUTERMOST, _UNTURNED_DEG, _MOST_POINTS = 0.02, 0.3, 500


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


def scan_features(
    done: Completion,
    scan: Points,
    rival: float,
    R_sensor_canonical: Float[Tensor, "3 3"],
    standing: Standing | None,
) -> ScanFeatures:
    """All features of one completion.

    Args:
        done: with its pose refined.
        scan: without the ground, sensor frame, metres.
        rival: see `rival_margin`.
        R_sensor_canonical: as the network said.
        standing: what rays say of the shape's points, if any are known.
    """
    known, box = ConfidenceFeatures(*done.features), done.box
    half = np.maximum(box.size, SMALLEST_M) / 2
    inside = (scan - np.asarray(box.centre)) @ box_axes(box.quaternion_wxyz)
    low, high = quantiles(inside.T, (_OUTERMOST, 1 - _OUTERMOST))
    seen_length, seen_width, _ = ((high - low) / (2 * half)).tolist()
    turn = R_sensor_canonical.double().mT @ done.pose.rotation
    moved = math.degrees(float(rotation_angle(turn)))
    shares = (math.nan, math.nan)
    if standing is not None:
        shares = (float(standing.free.mean()), float(standing.hidden.mean()))
    return ScanFeatures(
        log_cost=known.log_cost,
        rival=rival,
        entropy=known.entropy,
        log_moved=math.log(moved + _UNTURNED_DEG),
        log_points=known.log_points,
        log_range=known.log_range,
        seen_length=seen_length,
        seen_width=seen_width,
        deep=float((np.abs(inside) < half - DEEP_M).all(1).mean()),
        log_length=math.log(max(box.size[0], SMALLEST_M)),
        size_off=size_off(box.size),
        free=shares[0],
        hidden=shares[1],
    )


def track_features(
    done: Sequence[Completion],
    T_sensor_object: SE3,
    size: tuple[float, float, float],
    cost: Float[Tensor, "V"],
) -> list[TrackFeatures]:
    """All features of a track, a record a scan.

    Args:
        done: each scan on its own, with its features.
        T_sensor_object: the track's poses.
        size: of the track's box, metres.
        cost: label-free, of the track's shape in every scan, metres.
    """
    own = [ScanFeatures(*item.evidence) for item in done]
    points = np.exp([one.log_points for one in own])
    weights = np.sqrt(np.minimum(points, _MOST_POINTS))
    ahead = torch.stack([item.pose.rotation[:, 0] for item in done])
    alike = (ahead * T_sensor_object.rotation[:, :, 0]).sum(-1).numpy()
    costs = np.log(np.maximum(cost.numpy(), SMALLEST_M))

    def mean(values: Sequence[float] | np.ndarray) -> float:
        return float(np.average(values, weights=weights))

    together = TrackFeatures(
        log_cost=mean(costs),
        scan_cost=0.0,
        rival=mean([one.rival for one in own]),
        log_moved=mean([one.log_moved for one in own]),
        seen_width=mean([one.seen_width for one in own]),
        own_off=mean([one.size_off for one in own]),
        agree=mean(alike > math.cos(math.radians(RIVAL_DEG))),
        length_spread=float(np.std([one.log_length for one in own])),
        log_points=max(one.log_points for one in own),
        log_scans=math.log(len(own)),
        log_length=math.log(max(size[0], SMALLEST_M)),
        size_off=size_off(size),
    )
    return [together._replace(scan_cost=float(one)) for one in costs]
