# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The boxes that somebody else's detector found, in any format that we read (docs/drive.md)."""

import hashlib
from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detector import DetectorBox, upright_box
from wildshape.io.boxes.detector_kitti import read_kitti_file
from wildshape.io.boxes.detector_results import read_results
from wildshape.io.boxes.table import read_box_table
from wildshape.io.guard import reading

_FORMATS = "KITTI's .txt, nuScenes', OpenPCDet's or mmdetection3d's .json, or boxes.csv"
_PICKLES = (".pkl", ".pickle")


def read_detector_boxes(path: Path, T_rect_sensor: SE3) -> list[DetectorBox]:
    """All boxes of a file, or of the files in a folder by name.

    Args:
        path: of either.
        T_rect_sensor: from the scans' frame to KITTI's rectified camera frame.

    Raises:
        BadInputError: no such format, or a file of it that is damaged.
    """
    return [box for file in _files(path) for box in _read(file, T_rect_sensor)]


def takes_calibration(path: Path) -> bool:
    """Whether a file, or one of a folder, is of KITTI, whose boxes are in a camera's frame.

    Raises:
        BadInputError: no such file or folder.
    """
    return any(file.suffix.lower() == ".txt" for file in _files(path))


def fingerprint(path: Path) -> str:
    """What tells a file, or the files in a folder, from others."""
    digest = hashlib.sha256()
    for file in _files(path):
        with reading(file, "boxes"):
            content = file.read_bytes()
        digest.update(f"{file.name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:16]


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BadInputError(f"{path}: no such file or folder; --detections takes {_FORMATS}.")
    shown = (file for file in path.iterdir() if not file.name.startswith("."))
    files = sorted(file for file in shown if file.suffix in (".txt", ".json"))
    if not files:
        raise BadInputError(f"{path}: holds no .txt and no .json; --detections takes {_FORMATS}.")
    return files


def _read(path: Path, T_rect_sensor: SE3) -> list[DetectorBox]:
    kind = path.suffix.lower()
    if kind == ".txt":
        return read_kitti_file(path, T_rect_sensor)
    if kind == ".json":
        return read_results(path)
    if kind == ".csv":
        return _table(path)
    if kind in _PICKLES:
        raise BadInputError(
            f"{path}: a pickle runs code when it is read; write its lists as JSON (docs/drive.md)."
        )
    raise BadInputError(f"{path}: no format of boxes; --detections takes {_FORMATS}.")


def _table(path: Path) -> list[DetectorBox]:
    """A `boxes.csv`: kinds unknown, every box of a track."""
    rows = read_box_table(path)
    with reading(path, "boxes of a drive"):
        return [
            DetectorBox(
                scan=row.frame,
                category="",
                track=row.track,
                box=upright_box(
                    (row.x, row.y, row.z), (row.length, row.width, row.height), row.yaw
                ),
                score=row.confidence,
            )
            for row in rows
        ]
