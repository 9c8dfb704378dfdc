# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes given as KITTI's labels: of its object benchmark, a file a scan, or of its tracking.

A line of tracking begins with the scan's number and the object's, and goes on as a line of the
object benchmark: type, truncated, occluded, alpha, image box, height, width, length, x, y, z of the
floor's middle in the rectified camera frame, turn about its y, and perhaps a score.
"""

from collections.abc import Iterator
from math import cos, sin
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detections import moved
from wildshape.io.boxes.detector import DetectorBox, check_radians, checked
from wildshape.io.guard import reading
from wildshape.records import Box

_IGNORED = "DontCare"
_SCORE = 15  # its place in a line of the object benchmark
_OBJECT, _TRACKING = (15, 16), (17, 18)  # fields of a line, without and with a score


def read_kitti_file(path: Path, T_rect_sensor: SE3) -> list[DetectorBox]:
    """The boxes of one file; of the object benchmark's the scan is the file's name.

    Raises:
        BadInputError: it cannot be read, or a line has another format.
    """
    T_sensor_rect = T_rect_sensor.inverse()
    with reading(path, "labels of KITTI, with 15 to 18 fields a line"):
        lines = path.read_text("utf-8-sig").splitlines()
        return list(_boxes(lines, path.stem, T_sensor_rect))


def _boxes(lines: list[str], stem: str, T_sensor_rect: SE3) -> Iterator[DetectorBox]:
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        scan, track = stem, None
        if len(words) in _TRACKING:
            scan, track = str(int(words[0])), int(words[1])
            words = words[2:]
        elif len(words) not in _OBJECT:
            raise ValueError(f"line {number} has {len(words)} fields")
        if words[0] != _IGNORED:
            name = f"{track:04d}" if track is not None and track >= 0 else None
            yield _given(words, scan, name, T_sensor_rect)


def _given(words: list[str], scan: str, track: str | None, T_sensor_rect: SE3) -> DetectorBox:
    height, width, length, x, y, z, turn = map(float, words[8:15])
    qw, qx, qy, qz = quaternion_from_rotation(box_axes(check_radians(turn))).tolist()
    upright = Box((x, y - height / 2, z), (length, width, height), (qw, qx, qy, qz))
    score = float(words[_SCORE]) if len(words) > _SCORE else None
    return DetectorBox(scan, words[0], track, moved(checked(upright), T_sensor_rect), score)


def box_axes(turn: float) -> Float[Tensor, "3 3"]:
    """Forward is camera x turned by `turn` about camera y (down); up is camera -y."""
    c, s = cos(turn), sin(turn)
    return torch.tensor(((c, s, 0.0), (0.0, 0.0, -1.0), (-s, c, 0.0)), dtype=torch.float64)
