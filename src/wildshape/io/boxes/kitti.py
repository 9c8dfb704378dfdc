# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes as labels of KITTI tracking: a line a box, in the rectified camera frame, yaw alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.box import SIGNS
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import write_text
from wildshape.io.boxes.detections import Detection, moved, pose_of
from wildshape.records import Box

_NAMES = ("Car", "Van", "Truck", "Pedestrian", "Person", "Person_sitting", "Cyclist", "Tram")
_TYPES = {name.lower(): name for name in _NAMES}
_UNKNOWN, _NO_IMAGE = "Misc", (-1.0, -1.0, -1.0, -1.0)


@dataclass(frozen=True)
class KittiCamera:
    """Where KITTI's labels live.

    Attributes:
        T_rect_sensor: from the scans' frame to the rectified camera frame (x right, y down, z
            forward).
        projection: `P2`, rectified camera frame to pixels; None leaves the image box out (-1).
    """

    T_rect_sensor: SE3
    projection: Float[np.ndarray, "3 4"] | None = None


def camera_at_the_lidar() -> KittiCamera:
    """No calibration: a camera at the LiDAR's own place that looks along its x axis."""
    axes = torch.tensor(((0, -1, 0), (0, 0, -1), (1, 0, 0)), dtype=torch.float64)
    return KittiCamera(SE3(axes, torch.zeros(3, dtype=torch.float64)))


def write_kitti_labels(
    folder: Path, detections: Sequence[Detection], camera: KittiCamera
) -> list[Path]:
    """Write labels as KITTI tracking's label_02 has them, with a score at the end of a line.

    A drive is a file, `SEQUENCE.txt`, by frame and track, as evaluations read it. Where no drive is
    known each track is a file, `TRACK.txt`.

    Scans of a camera are in a camera's frame already and stay there. Truncation and occlusion are
    not known (-1). A line holds a turn about the camera's y and no other: a box that leans is
    stood upright about its centre.
    """
    lines: dict[str, list[str]] = {}
    for one in sorted(detections, key=_place):
        lines.setdefault(one.sequence or one.track, []).append(_line(one, camera))
    for name, rows in lines.items():
        write_text(folder / f"{name}.txt", "".join(f"{row}\n" for row in rows))
    return [folder / f"{name}.txt" for name in lines]


def _place(one: Detection) -> tuple[int, int]:
    """Where a box stands in a drive's file; tracks keep their order."""
    return (one.scan_number, one.track_number) if one.sequence else (0, 0)


def _line(one: Detection, camera: KittiCamera) -> str:
    kind = _TYPES.get(one.category.lower(), _UNKNOWN)
    box = one.box if one.sensor == "camera" else moved(one.box, camera.T_rect_sensor)
    line = label_line(one.scan_number, one.track_number, kind, box, camera.projection)
    return f"{line} {one.score:.6f}"


def label_line(
    frame: int,
    track: int,
    kind: str,
    box: Box,
    projection: Float[np.ndarray, "3 4"] | None = None,
) -> str:
    """A line of label_02, without a score.

    `kind`: as KITTI names it, for example `Car`. The box is in the rectified camera frame; one that
    leans is stood upright about its centre. `projection`: see `KittiCamera`.
    """
    (x, y, z), (length, width, height) = box.centre, box.size
    forward = pose_of(box).rotation[:, 0]
    turn = math.atan2(-float(forward[2]), float(forward[0]))
    alpha = math.remainder(turn - math.atan2(x, z), 2 * math.pi)
    image = _NO_IMAGE if projection is None else _image_box(box, turn, projection)
    numbers = (alpha, *image, height, width, length, x, y + height / 2, z, turn)
    words = " ".join(f"{number:.6f}" for number in numbers)
    return f"{frame} {track} {kind} -1 -1 {words}"


def _image_box(box: Box, turn: float, projection: Float[np.ndarray, "3 4"]) -> tuple[float, ...]:
    """Left, top, right, bottom of the upright box, pixels, not cut at the image's edge.

    -1 behind the camera.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    axes = np.array(((cos, 0.0, -sin), (sin, 0.0, cos), (0.0, -1.0, 0.0)))  # a row an axis
    corners = SIGNS * np.asarray(box.size) / 2 @ axes + np.asarray(box.centre)
    u, v, depth = projection @ np.pad(corners, ((0, 0), (0, 1)), constant_values=1.0).T
    if (depth <= 0).any():
        return _NO_IMAGE
    u, v = u / depth, v / depth
    return float(u.min()), float(v.min()), float(u.max()), float(v.max())
