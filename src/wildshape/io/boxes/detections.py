# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of many scans as one list, and as the JSON that needs no other project's conventions."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import torch

from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import write_json
from wildshape.io.boxes.detector import check_turn
from wildshape.io.guard import reading
from wildshape.io.poses import places_of
from wildshape.records import Box, SensorKind

FRAME = (
    "centre and quaternion (w, x, y, z; box to frame) in each scan's own sensor frame, metres; "
    "size along the box's own x (forward), y (left), z (up)"
)

_IF_KNOWN = ("sequence", "time_ns", "points", "velocity")

_MOST_DIGITS = 255  # no file has a longer name
_TOO_LARGE = 2**63  # for a column of int64
_LARGEST_COUNT = 10**10  # larger numbers are times


@dataclass(frozen=True)
class Detection:
    """One object in one scan.

    Attributes:
        track: name of the object.
        track_number: of the object among all that are written, from 0, or what its name counts.
        scan: name.
        scan_number: the scan's name where that is a whole number, else its place in the track.
        category: for example `car`; empty if unknown.
        sensor: tells the axes of the frame.
        score: confidence, 0 to 1.
        sequence: name of the drive; empty where each track is one of its own.
        time_ns: when the scan was taken, if known.
        points: of the scan that belong to the object, if known.
        velocity: `(2,)` over the ground, along the sensor's x and y, m/s, if known.
    """

    track: str
    track_number: int
    scan: str
    scan_number: int
    category: str
    sensor: SensorKind
    score: float
    box: Box
    sequence: str = ""
    time_ns: int | None = None
    points: int | None = None
    velocity: tuple[float, float] | None = None


def pose_of(box: Box) -> SE3:
    """`T_sensor_box`, float64; origin at the box's centre."""
    return poses_of([box])[0]


def poses_of(boxes: Sequence[Box]) -> SE3:
    """The same of several boxes, one batch."""
    wxyz = torch.tensor([box.quaternion_wxyz for box in boxes], dtype=torch.float64).view(-1, 4)
    centres = torch.tensor([box.centre for box in boxes], dtype=torch.float64).view(-1, 3)
    return SE3(rotation_from_quaternion(wxyz), centres)


def moved(box: Box, T_target_sensor: SE3) -> Box:
    """The same box in another frame."""
    T_sensor_box = pose_of(box)
    T = T_target_sensor.to(T_sensor_box.rotation.dtype) @ T_sensor_box
    x, y, z = T.translation.tolist()
    qw, qx, qy, qz = quaternion_from_rotation(T.rotation).tolist()
    return Box((x, y, z), box.size, (qw, qx, qy, qz))


def number_of(scan: str, place: int) -> int:
    """What a scan's name counts, or else its place in the track."""
    counts = scan.isascii() and scan.isdigit() and len(scan) <= _MOST_DIGITS
    return int(scan) if counts and int(scan) < _TOO_LARGE else place


def frame_numbers(scans: Sequence[str]) -> list[int]:
    """The numbers of a drive's scans: what each name counts, or its frame if that is a time.

    Frames alone if two scans would have one number.
    """
    numbers = [number_of(scan, frame) for frame, scan in enumerate(scans)]
    numbers = [n if n < _LARGEST_COUNT else frame for frame, n in enumerate(numbers)]
    return numbers if len(set(numbers)) == len(numbers) else list(range(len(numbers)))


def read_detections(out: Path) -> list[Detection]:
    """The boxes of the `objects.json` of every track below `out`, by track and scan.

    Raises:
        BadInputError: one of these files is damaged.
    """
    found: list[Detection] = []
    for number, path in enumerate(sorted(out.glob("*/objects.json"))):
        with reading(path, "what complete or register writes"):
            said = json.loads(path.read_text("utf-8"))
            if said["track"] != path.parent.name:  # it becomes a file's name
                raise ValueError(f"track {said['track']!r} in the folder {path.parent.name!r}")
            found += detections_of(said, number)
    return found


def detections_of(said: dict[str, Any], number: int) -> Iterator[Detection]:
    """The boxes of one track's `objects.json`; `number`: of the track.

    Raises:
        ValueError: a value makes no sense (KeyError, TypeError: is missing, is of another type).
    """
    kind = said.get("sensor", "lidar")
    if kind not in get_args(SensorKind):
        raise ValueError(f"sensor {kind!r}")
    names = [_text(scan["scan"]) for scan in said["scans"]]
    skipped = [_text(scan["scan"]) for scan in said.get("skipped", ())]
    for place, name, scan in zip(places_of(names, skipped), names, said["scans"]):
        yield Detection(
            track=_text(said["track"]),
            track_number=number,
            scan=name,
            scan_number=number_of(name, place),
            category=_text(said.get("category") or ""),
            sensor=kind,
            score=_finite([scan["confidence"]])[0],
            box=read_box(scan["box"]),
        )


def _text(raw: object) -> str:
    """A text that a file can hold: half of a pair of surrogates raises `UnicodeEncodeError`."""
    text = str(raw)
    text.encode()
    return text


def read_box(raw: dict[str, Any]) -> Box:
    """The box of an entry of objects.json.

    Raises:
        ValueError: a number makes no sense (KeyError, TypeError: is missing, is none).
    """
    x, y, z = _finite(raw["centre"])
    length, width, height = _finite(raw["size"])
    qw, qx, qy, qz = _finite(raw["quaternion_wxyz"])
    return check_turn(Box((x, y, z), (length, width, height), (qw, qx, qy, qz)))


def _finite(raw: Sequence[Any]) -> list[float]:
    numbers = [float(number) for number in raw]
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"{numbers}, which are not all finite")
    return numbers


def write_box_list(path: Path, detections: Sequence[Detection]) -> None:
    """Write all boxes as one JSON object, atomically; what is not known is left out."""
    rows = [
        {
            name: value
            for name, value in {**asdict(one), **asdict(one.box)}.items()
            if name != "box" and not (name in _IF_KNOWN and value in (None, ""))
        }
        for one in detections
    ]
    write_json(path, {"format": 1, "frame": FRAME, "boxes": rows})
