# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What somebody else's detector found in a drive, in place of its clusters.

The points in each box, the ground taken away, are the cluster (`box_cutter.py`). Boxes that carry
tracks keep them.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.arguments import check_fields
from wildshape.drives.source import Drive
from wildshape.drives.tracking.segmentation import CutScan
from wildshape.drives.tracking.sightings import Sightings
from wildshape.errors import BadInputError
from wildshape.inference.folders.box_files import read_camera
from wildshape.io.boxes.detections import frame_numbers, number_of, pose_of
from wildshape.io.boxes.detector import DetectorBox
from wildshape.io.boxes.kitti import camera_at_the_lidar
from wildshape.io.boxes.read_detector import (
    fingerprint,
    is_box_table,
    read_detector_boxes,
    takes_calibration,
)
from wildshape.io.output import file_name
from wildshape.records import Box, Points

# Of KITTI, nuScenes, Waymo and Argoverse 2; an empty kind is not known.
VEHICLES = frozenset(
    (
        *("", "car", "van", "truck", "bus", "trailer", "vehicle", "construction_vehicle"),
        *("construction", "emergency", "regular_vehicle", "large_vehicle", "box_truck"),
        *("truck_cab", "vehicular_trailer", "school_bus", "articulated_bus", "pickup", "suv"),
    )
)


# Points that boxes turned by a quarter hold, of those that they hold as given: a quarter to 0.4 on
# streets and a real drive, 0.75 half a length off, 0.9 in another frame, 4 with wrong headings.
_OFF, _TURNED = 0.6, 2.0
_LONGER = 1.5  # than wide; of others a turn changes nothing
_ABOVE_FLOOR_M = 0.3
_ASKED_SCANS, _FEWEST_POINTS = 5, 200


@dataclass(frozen=True)
class DetectionFile:
    """Where detections come from.

    Attributes:
        path: of a file, or a folder of them (docs/drive.md).
        calibration: KITTI's `.txt`, for labels of KITTI; without, their camera is taken to be at
            the LiDAR's place and to look along its x.
        least_score: boxes of a lower score are left out; those without one are kept.
    """

    path: Path
    calibration: Path | None = None
    least_score: float | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def identity(self) -> dict[str, Any]:
        """What decides what is found with them.

        Raises:
            BadInputError: a file cannot be read.
        """
        calibration = self.calibration and fingerprint(self.calibration)
        scored = {} if self.least_score is None else {"detections_least_score": self.least_score}
        given = {"detections": fingerprint(self.path), "detections_calibration": calibration}
        return {**given, **scored}

    def boxes(self, scans: int) -> list[DetectorBox]:
        """All of them; `scans`: of the drive.

        Raises:
            BadInputError: a file cannot be read, or has none of the scores asked for.
        """
        camera = read_camera(self.calibration) if self.calibration else camera_at_the_lidar()
        found = read_detector_boxes(self.path, camera.T_rect_sensor, scans)
        scored = not found or any(box.score is not None for box in found)
        if self.least_score is not None and not scored:
            raise BadInputError(f"{self.path}: no box has a score; leave --min-score away.")
        return found

    def is_sure(self, box: DetectorBox) -> bool:
        """Whether a box's score is high enough."""
        if self.least_score is None or box.score is None:
            return True
        return box.score >= self.least_score


@dataclass(frozen=True)
class Detections:
    """The vehicles that a detector found in a drive.

    Attributes:
        path: named in errors.
        frames: the boxes in each of its frames.
        tracked: every box knows its track.
        warnings: what was left out, a sentence each.
        corrected: the boxes lie on scans that were corrected for motion, as those of a drive do.
    """

    path: Path
    frames: tuple[tuple[DetectorBox, ...], ...]
    tracked: bool
    warnings: tuple[str, ...]
    corrected: bool = False

    @property
    def every(self) -> int:
        """The usual step from a frame with boxes to the next: detectors may see keyframes alone."""
        steps = np.diff([frame for frame, row in enumerate(self.frames) if row])
        return max(round(float(np.median(steps))), 1) if len(steps) else 1

    def told(self, kept: int, followed: int) -> list[str]:
        """What of them led to nothing, a sentence each.

        Args:
            kept: boxes that were cut out.
            followed: those of them that are in a track.
        """
        placed, empty = sum(map(len, self.frames)), sum(not row for row in self.frames)
        found = [f"{empty} of {len(self.frames)} scans have no detections"] if empty else []
        if kept < placed:
            found.append(
                f"{placed - kept} of {placed} detections are left out: they hold too few points or"
                " those of another"
            )
        if followed < kept:
            found.append(
                f"{kept - followed} of {placed} detections are left out: without tracks of their"
                " own, they follow each other in too few scans"
            )
        return found

    def noted(self, drive: Drive) -> Drive:
        """The drive, which says how its objects are cut out and what was left out."""
        cut_by = f"by the boxes of {self.path.name}"
        return replace(drive, warnings=(*drive.warnings, *self.warnings), cut_by=cut_by)


def find_detections(file: DetectionFile, drive: Drive) -> Detections:
    """The boxes of vehicles by frame.

    Raises:
        BadInputError: a file cannot be read; no box is of a vehicle and of a scan of the drive; a
            track has two boxes in one frame.
    """
    given = file.boxes(len(drive))
    boxes = [box for box in given if file.is_sure(box)]
    vehicles = [box for box in boxes if _is_vehicle(box.category)]
    others = Counter(box.category for box in boxes if not _is_vehicle(box.category))
    listed = ", ".join(f"{count} {kind}" for kind, count in others.most_common())
    if not vehicles:
        least = "" if file.least_score is None else f" that scores {file.least_score:g}"
        raise BadInputError(
            f"{file.path}: no box of a vehicle{least} among {listed or 'none at all'}."
        )
    frames = _by_frame(vehicles, drive)
    placed = sum(map(len, frames))
    if not placed:
        raise BadInputError(
            f"{file.path}: its scans, for example '{vehicles[0].scan}', are none of {drive.told}'s,"
            f" for example '{drive.scan_names[0]}'; name them alike."
        )
    warnings = [*_calibration_told(file), *_named_twice_told(frames, drive.scan_names)]
    if len(boxes) < len(given):
        left = len(given) - len(boxes)
        warnings.append(f"{left} detections score less than {file.least_score:g} and are left out")
    if others:
        warnings.append(f"detections that are no vehicles are left out: {listed}")
    if placed < len(vehicles):
        left = len(vehicles) - placed
        told = f"{left} detections belong to scans that the drive does not have"
        warnings.append(told + _shift_told(vehicles, frames, frame_numbers(drive.scan_names)))
    without = sum(box.track is None for row in frames for box in row)
    if not without:
        _check_tracks(file.path, frames)
    told = _untracked_told(without, placed)
    corrected = is_box_table(file.path)  # of a drive: the scans are corrected later
    told += [] if corrected else _turned_told(frames, drive)
    return Detections(file.path, frames, not without, (*warnings, *told), corrected)


def _calibration_told(file: DetectionFile) -> list[str]:
    """A sentence if a calibration is given and not needed, or needed and not given."""
    if takes_calibration(file.path) == (file.calibration is not None):
        return []
    if file.calibration is not None:
        return [f"{file.calibration.name} is not used: only KITTI's boxes need it"]
    return [
        f"{file.path.name} is taken to be of a camera at the LiDAR's own place that looks along x;"
        " pass the calibration of the real one"
    ]


def _named_twice_told(frames: Sequence[Sequence[DetectorBox]], scans: Sequence[str]) -> list[str]:
    """A sentence if boxes of two names, as `0` and `000000`, lie on one scan."""
    named = [sorted({str(box.scan) for box in row}) for row in frames]
    twice = next((place for place, names in enumerate(named) if len(names) > 1), None)
    if twice is None:
        return []
    one, other, *_ = named[twice]
    return [f"boxes of '{one}' and of '{other}' are all taken to be of scan {scans[twice]}"]


def _is_vehicle(category: str) -> bool:
    words = category.lower().split(".")
    return not VEHICLES.isdisjoint(words[:1] if len(words) == 1 else words[1:])


def _by_frame(boxes: list[DetectorBox], drive: Drive) -> tuple[tuple[DetectorBox, ...], ...]:
    """A scan is known by its name, by the end of a path, or by its number."""
    names = {name: frame for frame, name in enumerate(drive.scan_names)}
    numbers = {number: frame for frame, number in enumerate(frame_numbers(drive.scan_names))}
    frames: list[list[DetectorBox]] = [[] for _ in drive.scan_names]
    for box in boxes:
        frame = _frame(box.scan, names, numbers)
        if frame is not None and 0 <= frame < len(frames):
            frames[frame].append(box)
    return tuple(map(tuple, frames))


def _frame(scan: str | int, names: dict[str, int], numbers: dict[int, int]) -> int | None:
    if isinstance(scan, int):
        return scan
    path = PurePosixPath(scan)
    for name in (scan, path.name, path.stem):
        if name in names:
            return names[name]
    return numbers.get(_counted(scan))


def _counted(scan: str | int) -> int:
    """The number that a scan's name is, in any folder, with or without a file's ending; or -1.

    `12.05` is a time, and not the file of scan 12.
    """
    path = PurePosixPath(str(scan))
    return number_of(path.name if path.suffix[1:].isdigit() else path.stem, -1)


def _shift_told(
    boxes: list[DetectorBox], frames: Sequence[Sequence[DetectorBox]], numbers: list[int]
) -> str:
    """What else to say where boxes lie one scan off: they begin and end one after the drive."""
    theirs = [_counted(one.scan) for one in boxes]
    late = not frames[0] and max(theirs) == numbers[-1] + 1
    early = not frames[-1] and min(theirs) == numbers[0] - 1 >= 0
    if not (late or early):
        return ""
    return (
        f", and scan {numbers[0] if late else numbers[-1]} has none: if they are numbered from"
        f" {numbers[0] + (1 if late else -1)}, number them from {numbers[0]}"
    )


def _untracked_told(without: int, placed: int) -> list[str]:
    """A sentence if some boxes have tracks and others have none."""
    if without in (0, placed):
        return []
    return [f"{without} of {placed} detections have no track: tracks are found anew"]


def _turned_told(frames: Sequence[Sequence[DetectorBox]], drive: Drive) -> list[str]:
    """A sentence if boxes do not lie on what stands there, as those of another frame do not."""
    given, turned = _points_held(frames, drive)
    if given + turned < _FEWEST_POINTS or turned < _OFF * given:
        return []
    if turned > _TURNED * given:
        return [
            "boxes hold far more points if each is turned by 90 degrees: give yaw from x to y, and"
            " the length along it"
        ]
    return [
        "boxes hold hardly more points than if each were turned by 90 degrees, as if they lay"
        " beside the vehicles: give boxes in each scan's own sensor frame"
    ]


def _points_held(frames: Sequence[Sequence[DetectorBox]], drive: Drive) -> tuple[float, float]:
    """How many points the boxes of some scans hold, and hold if each is turned by a quarter."""
    shown = [frame for frame, row in enumerate(frames) if row]
    held = np.zeros(2)
    for frame in shown[:: max(len(shown) // _ASKED_SCANS, 1)]:
        points = drive.turn(frame).points
        held += sum((_held(one.box, points) for one in frames[frame]), np.zeros(2))
    given, turned = held.tolist()
    return given, turned


def _held(box: Box, points: Points) -> Float[np.ndarray, "2"]:
    """How many points above its floor a long box holds, as it is and turned by a quarter."""
    length, width, height = box.size
    if max(length, width) < _LONGER * min(length, width):
        return np.zeros(2)
    apart = np.abs(pose_of(box).inverse().apply_numpy(points))
    apart = apart[apart[:, 2] < height / 2 - _ABOVE_FLOOR_M, :2]
    sides = np.array(((length, width), (width, length))) / 2
    return (apart < sides[:, None]).all(-1).sum(1).astype(np.float64)


def _check_tracks(path: Path, frames: Iterable[tuple[DetectorBox, ...]]) -> None:
    for frame, row in enumerate(frames):
        for track, count in Counter(box.track or "" for box in row).items():
            try:
                file_name(track)
            except BadInputError as error:
                raise BadInputError(f"{path}: {error}") from error
            if count > 1:
                raise BadInputError(
                    f"{path}: {count} boxes of track '{track}' in frame {frame}; a track has one."
                )


def given_tracks(cuts: Iterable[CutScan]) -> list[Sightings]:
    """The objects by the tracks of their boxes."""
    counts = []
    seen: dict[str, tuple[list[int], list[int]]] = {}
    for frame, cut in enumerate(cuts):
        counts.append(cut.counts)
        for row, track in enumerate(cut.tracks):
            frames, rows = seen.setdefault(track, ([], []))
            frames.append(frame)
            rows.append(row)
    return [
        Sightings.of(track, frames, rows, counts) for track, (frames, rows) in sorted(seen.items())
    ]
