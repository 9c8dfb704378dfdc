# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes given as JSON: results of nuScenes, OpenPCDet and mmdetection3d."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.boxes.detector import DetectorBox, checked, upright_box
from wildshape.io.guard import read_json, reading
from wildshape.records import Box

_LIDAR = "LiDAR"


def read_results(path: Path, scans: int) -> list[DetectorBox]:
    """The boxes of one file.

    A JSON object with `results` is of nuScenes; its boxes are taken to be in each scan's sensor
    frame, as `write_nuscenes_boxes` writes them. A list is of OpenPCDet or mmdetection3d, an object
    a scan; an object with `bboxes_3d` is one scan of mmdetection3d, named as the file.

    `scans`: of the drive; a list that does not name its own has as many.

    Raises:
        BadInputError: it cannot be read, holds something else, or a list of other scans.
    """
    expected = "results of nuScenes, OpenPCDet or mmdetection3d in JSON"
    said = read_json(path, expected)
    with reading(path, expected):
        if isinstance(said, list):
            if len(said) != scans and any("frame_id" not in one for one in said):
                raise BadInputError(
                    f"{path}: a list of {len(said)} scans, and the drive has {scans}; name each by"
                    " its 'frame_id'."
                )
            _check_once(path, said)
            return [box for place, one in enumerate(said) for box in _scan(one, place)]
        if "bboxes_3d" in said:
            return list(_scan({"frame_id": path.stem, **said}, 0))
        return [_nuscenes(row, scan) for scan, rows in said["results"].items() for row in rows]


def _check_once(path: Path, said: list[dict[str, Any]]) -> None:
    """Refuse a list that holds a scan twice, as of a run that was repeated: so would its boxes be.

    Raises:
        BadInputError: it does.
    """
    counts = Counter(str(one["frame_id"]) for one in said if "frame_id" in one)
    for scan, count in counts.most_common(1):
        if count > 1:
            raise BadInputError(f"{path}: holds scan '{scan}' {count} times; keep one of them.")


def _nuscenes(row: dict[str, Any], scan: str) -> DetectorBox:
    """A record of detection, or of tracking; its size is width, length, height."""
    x, y, z = map(float, row["translation"])
    width, length, height = map(float, row["size"])
    qw, qx, qy, qz = map(float, row["rotation"])
    kind = "detection" if "detection_name" in row else "tracking"
    track = row.get("tracking_id")
    return DetectorBox(
        scan=scan,
        category=str(row[f"{kind}_name"]),
        track=None if track is None else str(track),
        box=checked(Box((x, y, z), (length, width, height), (qw, qx, qy, qz))),
        score=_number(row.get(f"{kind}_score")),
    )


def _number(score: Any) -> float | None:
    return None if score is None else float(score)


def _scan(said: dict[str, Any], place: int) -> Iterator[DetectorBox]:
    """One scan of OpenPCDet or mmdetection3d; without a `frame_id` it is known by its place."""
    scan = str(said["frame_id"]) if "frame_id" in said else place
    boxes = _floor_boxes(said) if "bboxes_3d" in said else said["boxes_lidar"]
    scores = said.get("score", said.get("scores_3d")) or [None] * len(boxes)
    for box, name, score in zip(boxes, _names(said), scores, strict=True):
        x, y, z, length, width, height, yaw = map(float, box[:7])
        given = upright_box((x, y, z), (length, width, height), yaw)
        yield DetectorBox(scan, name, None, given, _number(score))


def _floor_boxes(said: dict[str, Any]) -> list[list[Any]]:
    """mmdetection3d's boxes, whose z is that of the floor, with the z of their middle."""
    kind = said.get("box_type_3d", _LIDAR)
    if kind != _LIDAR:
        raise ValueError(f"box_type_3d {kind!r}, not {_LIDAR!r}")
    return [[x, y, z + size[2] / 2, *size] for x, y, z, *size in said["bboxes_3d"]]


def _names(said: dict[str, Any]) -> list[str]:
    """Of the kinds: a text a box."""
    names = said.get("name", said.get("labels_3d"))
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError("no 'name', a list with the kind of each box as a text")
    return names
