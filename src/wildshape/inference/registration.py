# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans registered through the poses of one object (METHOD 7)."""

from collections.abc import Iterable, Sequence

import numpy as np
import torch

from wildshape.arguments import expect
from wildshape.errors import BadInputError
from wildshape.geometry.box import extent
from wildshape.geometry.transforms.se3 import SE3, several
from wildshape.inference.config import InlierRule
from wildshape.ops.device import plain_torch
from wildshape.ops.nearest import nearest
from wildshape.records import Completion, Points, Registration

_RULE = InlierRule()


def to_middle(T_sensor_canonical: SE3 | np.ndarray | Sequence[SE3]) -> SE3:
    """`T_middle_scan = T_middle_can inv(T_scan_can)` of every scan of a track.

    Raises:
        BadInputError: no poses, or one alone.
    """
    T_sensor_canonical = several(T_sensor_canonical, "poses")
    if not T_sensor_canonical:
        raise BadInputError("poses: expected one a scan, found none.")
    middle = T_sensor_canonical[len(T_sensor_canonical) // 2]
    return middle @ T_sensor_canonical.inverse()


def fuse_scans(scans: Iterable[Points], T_middle_scan: SE3 | np.ndarray | Sequence[SE3]) -> Points:
    """The scans' points, moved and joined.

    Raises:
        BadInputError: no scans, or another number of poses.
    """
    scans, poses = list(scans), several(T_middle_scan, "poses")
    if len(scans) != len(poses) or not scans:
        raise BadInputError(f"{len(scans)} scans, {len(poses)} poses; pass one pose a scan.")
    moved = [T.apply_numpy(scan) for T, scan in zip(poses, scans)]
    return np.concatenate(moved).astype(np.float32)


@plain_torch()
def registered(
    source: Points,
    target: Points,
    done: Iterable[Completion],
    rule: InlierRule = _RULE,
) -> Registration:
    """`T_target_source = T_target_can inv(T_source_can)`; `done`: both scans completed."""
    done_source, done_target = done
    T_target_source = done_target.pose @ done_source.pose.inverse()
    ratio = inlier_ratio(T_target_source, source, target, rule)
    confidence = min(done_source.confidence, done_target.confidence)
    warning = done_source.warning or done_target.warning
    reasons = tuple(dict.fromkeys((*done_source.reasons, *done_target.reasons)))
    return Registration(T_target_source.owned(), ratio, confidence, warning, reasons)


def inlier_ratio(
    T_target_source: SE3, source: Points, target: Points, rule: InlierRule = _RULE
) -> float:
    """Share of moved source points near a target point (`Registration.inlier_ratio`).

    Raises:
        BadInputError: a cloud without points.
    """
    expect(T_target_source, SE3, "T_target_source", "SE3.from_matrix makes one of a matrix")
    if not (len(source) and len(target)):
        raise BadInputError("source and target: expected points, found none; check what made them.")
    reach = min(rule.within_m, rule.within_share * extent(target))
    moved = torch.from_numpy(T_target_source.apply_numpy(source))
    found = nearest(moved[None], torch.from_numpy(np.ascontiguousarray(target))[None])
    return float((found.distance_squared <= reach * reach).float().mean())
