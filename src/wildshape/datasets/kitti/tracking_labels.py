# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI tracking's `label_02/SSSS.txt`: boxes in the rectified frame of camera 2's rig."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from wildshape.datasets.tracks.labelled_boxes import check_boxes
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detector import MOST_TURN
from wildshape.io.boxes.detector_kitti import box_axes

CATEGORIES = (
    "Car",
    "Van",
    "Truck",
    "Pedestrian",
    "Person",
    "Person_sitting",
    "Cyclist",
    "Tram",
    "Misc",
)
_IGNORED = "DontCare"
_MOST = 1_000_000_000
_CURE = "download KITTI tracking's labels again"


@dataclass(frozen=True)
class LabelledBox:
    """One object in one frame.

    Attributes:
        track: the object's number, unique in its sequence.
        category: for example `Car`.
        size: full lengths along the box's own x (forward), y (left), z (up), metres.
        T_rect_object: in the rectified camera frame (x right, y down, z forward); origin at the
            box's CENTRE (the file's lies on its floor).
    """

    frame: int
    track: int
    category: str
    size: tuple[float, float, float]
    T_rect_object: SE3


def read_boxes(path: Path) -> list[LabelledBox]:
    """The boxes of a sequence in the file's order, regions that nobody cared to label left out.

    Raises:
        BadInputError: the file is missing, a line is not of KITTI tracking's format, or an object
            has two boxes in a frame.
    """
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; KITTI tracking's label archive brings it.")
    lines = path.read_text(errors="replace").splitlines()
    rows = [(f"{path}, line {i}", line.split()) for i, line in enumerate(lines, start=1)]
    boxes, seen = [], set[tuple[int, int]]()
    for where, words in rows:
        if not words or words[2:3] == [_IGNORED]:
            continue
        box = _box(words, where)
        if (box.frame, box.track) in seen:
            raise BadInputError(
                f"{where}: object {box.track} has a box in frame {box.frame} already; {_CURE}."
            )
        seen.add((box.frame, box.track))
        boxes.append(box)
    return boxes


def _box(words: list[str], where: str) -> LabelledBox:
    if len(words) not in (17, 18):
        raise BadInputError(
            f"{where}: {len(words)} fields, expected 17 of KITTI tracking's labels (frame, track, "
            "type, ...); give the folder label_02 as published."
        )
    if words[2] not in CATEGORIES:
        raise BadInputError(
            f"{where}: type '{words[2]}' is none of KITTI tracking's: {', '.join(CATEGORIES)}."
        )
    try:
        frame, track = int(words[0]), int(words[1])
        height, width, length, x, y, z, turn = map(float, words[10:17])
    except ValueError:
        raise BadInputError(f"{where}: a field is no number; {_CURE}.") from None
    if not abs(turn) <= MOST_TURN or not 0 <= frame < _MOST or not 0 <= track < _MOST:
        raise BadInputError(
            f"{where}: frame {words[0]}, object {words[1]}, turn {turn} radians; {_CURE}."
        )
    centre = torch.tensor((x, y - height / 2, z), dtype=torch.float64)
    pose = SE3(box_axes(turn), centre)
    check_boxes(np.asarray([[length, width, height]]), pose, where, _CURE)
    return LabelledBox(frame, track, words[2], (length, width, height), pose)
