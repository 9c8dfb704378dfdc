# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Predicted boxes against the true one: overlap, and which way they look."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from wildshape.evaluation.metrics import ACCURATE_DEG
from wildshape.geometry.box import FittedBox
from wildshape.geometry.box_overlap import box_iou
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Points


@dataclass(frozen=True)
class BoxScore:
    """One predicted box.

    Attributes:
        iou: shared over joint volume, 0 to 1, both boxes as they stand in space.
        heading_deg: turn about the object's vertical from the box's x to the object's, 0 to 180.
    """

    iou: float
    heading_deg: float


def true_box(shape: Points) -> FittedBox:
    """The tight box of a true shape, object frame, its axes those of that frame."""
    points = torch.from_numpy(shape).double()
    low, high = points.amin(0), points.amax(0)
    return FittedBox((low + high) / 2, high - low, torch.eye(3, dtype=torch.float64))


def box_score(predicted: Box, truth: FittedBox, T_sensor_object: SE3) -> BoxScore:
    """A box of the sensor frame against the true one of the object frame."""
    T_object_sensor = T_sensor_object.to(torch.float64).inverse()
    centre, size, wxyz = (
        torch.tensor(part, dtype=torch.float64)
        for part in (predicted.centre, predicted.size, predicted.quaternion_wxyz)
    )
    rotation = T_object_sensor.rotation @ rotation_from_quaternion(wxyz)
    found = FittedBox(T_object_sensor.apply(centre[None])[0], size, rotation)
    x, y = rotation[:2, 0].tolist()
    return BoxScore(box_iou(found, truth), abs(math.degrees(math.atan2(y, x))))


def box_figures(scores: Sequence[BoxScore]) -> dict[str, float | None]:
    """The figures of `metrics.json`.

    Which end of the canonical frame is the front is nobody's definition, but it is one end for all
    objects: `heading30` is that of the better of the two ends, chosen once for the whole row.
    """
    if not scores:
        return {}
    off = np.asarray([score.heading_deg for score in scores])
    symmetric = np.minimum(off, 180 - off)
    ends = [float((one <= ACCURATE_DEG).mean()) for one in (off, 180 - off)]
    return {
        "box_iou": float(np.mean([score.iou for score in scores])),
        "heading30": max(ends),
        "heading30_sym": float((symmetric <= ACCURATE_DEG).mean()),
        "heading_sym_median_deg": float(np.median(symmetric)),
    }
