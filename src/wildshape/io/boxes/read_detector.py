# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The boxes that somebody else's detector found, in any format that we read (docs/drive.md)."""

import hashlib
from collections import Counter
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


def read_detector_boxes(path: Path, T_rect_sensor: SE3, scans: int) -> list[DetectorBox]:
    """All boxes of a file, or of the files in a folder by name.

    Raises:
        BadInputError: no such format, a file of it that is damaged, or files of several drives.
    """
    found = {file: _read(file, T_rect_sensor, scans) for file in _files(path)}
    if len(found) > 1:
        _check_one_drive(path, found)
    return [box for boxes in found.values() for box in boxes]


def _check_one_drive(folder: Path, found: dict[Path, list[DetectorBox]]) -> None:
    """Refuse files of several drives, whose scans bear the same numbers.

    A file may be of one scan, or of one track, which has one box a scan.
    """
    files_of: dict[str | int, list[Path]] = {}
    whole = set[Path]()
    for file, boxes in found.items():
        counts = Counter(box.scan for box in boxes)
        if max(counts.values(), default=0) > 1:
            whole.add(file)
        for scan in counts:
            files_of.setdefault(scan, []).append(file)
    for scan, files in files_of.items():
        if len(files) > 1 and not whole.isdisjoint(files):
            raise BadInputError(
                f"{folder}: {files[0].name} and {files[1].name} both hold boxes of scan {scan}, as"
                " if they were of two drives; give the file of this drive alone."
            )


def is_box_table(path: Path) -> bool:
    """Whether a file is a `boxes.csv`, the boxes that a drive found."""
    return path.suffix.lower() == ".csv"


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
    files = sorted(file for file in shown if file.suffix.lower() in (".txt", ".json"))
    if not files:
        raise BadInputError(f"{path}: holds no .txt and no .json; --detections takes {_FORMATS}.")
    return files


def _read(path: Path, T_rect_sensor: SE3, scans: int) -> list[DetectorBox]:
    kind = path.suffix.lower()
    if kind == ".txt":
        return read_kitti_file(path, T_rect_sensor)
    if kind == ".json":
        return read_results(path, scans)
    if is_box_table(path):
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
