# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `wildshape drive` left in its folder: boxes, trajectory, and the points of each track."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.arguments import as_path
from wildshape.datasets.kitti.raw import read_velodyne
from wildshape.errors import BadInputError
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.same_scans import FRAMES, read_frames
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.table import BoxRow, read_box_table
from wildshape.io.inputs import open_tracks
from wildshape.io.poses import read_poses
from wildshape.records import Points

Cluster = tuple[int, str, Points]
"""Frame, track, and its points there, sensor frame, metres."""
Clusters = dict[tuple[int, str], Points]
"""Points of tracks, by frame and track."""
_AROUND_M, _ABOVE_M, _FEWEST = 0.3, 0.2, 5
BOXES, TRAJECTORY, TRACKS = "boxes.csv", "trajectory.txt", "tracks"


@dataclass(frozen=True)
class Found:
    """One vehicle found in one frame; a box in the sensor frame."""

    track: str
    confidence: float
    box: UprightBox


@dataclass(frozen=True)
class FoundDrive:
    """What was found in a drive.

    Attributes:
        frames: the vehicles of each scan.
        T_world_sensor: the trajectory, if there is one.
    """

    path: Path
    frames: tuple[tuple[Found, ...], ...]
    T_world_sensor: SE3 | None


def drives_of(path: Path, labels: Path) -> list[tuple[Path, Path]]:
    """Folders with boxes, each with its labels.

    Args:
        path: a folder with boxes, or a folder of such.
        labels: of the one drive; or else the folder of what bears the drives' names: folders with
            labels, or files of label_02.

    Raises:
        BadInputError: there are no boxes, or a drive has no labels.
    """
    if (path / BOXES).is_file():
        return [(path, labels)]
    found = sorted(folder.parent for folder in path.glob(f"[!.]*/{BOXES}"))
    if not found:
        raise BadInputError(
            f"{path}: no {BOXES} in it; give a folder that `wildshape drive` wrote."
        )
    return [(folder, _labels_of(folder.name, labels)) for folder in found]


def _labels_of(name: str, labels: Path) -> Path:
    files = (labels / f"{name}.txt", labels / "label_02" / f"{name}.txt")
    for place in (labels / name, *files, labels / "training" / "label_02" / f"{name}.txt"):
        if place.exists():
            return place
    raise BadInputError(f"{labels}: no labels of the drive {name}; name them as it is named.")


def read_found(path: Path | str, scans: int) -> FoundDrive:
    """The boxes and the trajectory of a drive of so many scans.

    Raises:
        BadInputError: boxes are missing or damaged, or are of another number of scans.
    """
    path = as_path(path, "path")
    frames: dict[int, list[Found]] = defaultdict(list)
    seen: set[tuple[int, str]] = set()
    for row in read_box_table(path / BOXES):
        _check(row, path / BOXES, scans)
        if (row.frame, row.track) in seen:
            raise BadInputError(
                f"{path / BOXES}: track {row.track} is in frame {row.frame} twice; write it anew."
            )
        seen.add((row.frame, row.track))
        frames[row.frame].append(Found(row.track, row.confidence, _upright(row)))
    trajectory = path / TRAJECTORY
    poses = read_poses(trajectory) if trajectory.is_file() else None
    if poses is not None and len(poses) != scans:
        raise BadInputError(
            f"{trajectory}: is of {len(poses)} scans, but the labels know {scans}; give the labels"
            " of this very drive, or find its vehicles in all its scans."
        )
    return FoundDrive(path, tuple(tuple(frames[i]) for i in range(scans)), poses)


def _check(row: BoxRow, path: Path, scans: int) -> None:
    where = f"{path}: frame {row.frame}, track {row.track}"
    if not 0 <= row.frame < scans:
        raise BadInputError(
            f"{where}: the labels know {scans} scans, 0 to {scans - 1}; give the labels of this"
            " very drive."
        )
    if min(row.length, row.width, row.height) <= 0 or not 0 <= row.confidence <= 1:
        raise BadInputError(
            f"{where}: a box of {row.length:g} x {row.width:g} x {row.height:g} m with confidence"
            f" {row.confidence:g}; sizes are over 0, confidences 0 to 1."
        )


def _upright(row: BoxRow) -> UprightBox:
    return UprightBox(row.x, row.y, row.z, row.length, row.width, row.height, row.yaw)


def points_inside(drive: FoundDrive, scans: Sequence[Path]) -> Iterator[Cluster]:
    """The points in and close around each found box, without the ground under it.

    For drives whose clusters were not kept; one scan is held at a time.

    Raises:
        BadInputError: a scan is damaged.
    """
    for number, (scan, frame) in enumerate(zip(scans, drive.frames)):
        points = read_velodyne(scan) if frame else np.empty((0, 3), np.float32)
        for one in frame:
            own = _inside(points, one.box)
            if len(own) >= _FEWEST:
                yield number, one.track, own


def _inside(points: Points, box: UprightBox) -> Points:
    c, s = np.cos(box.yaw), np.sin(box.yaw)
    turn = np.array(((c, -s, 0), (s, c, 0), (0, 0, 1)))
    own = (points - np.array(box[:3], np.float32)) @ turn
    near = (np.abs(own[:, :2]) < np.array(box[3:5]) / 2 + _AROUND_M).all(1)
    above = (own[:, 2] > _ABOVE_M - box.height / 2) & (own[:, 2] < box.height / 2)
    return points[near & above]


def kept_clusters(path: Path) -> Iterator[Cluster]:
    """What was kept of each track in each frame; one track is held at a time.

    Raises:
        BadInputError: the tracks or the list of frames are damaged.
    """
    if not (path / TRACKS).exists() or not (path / FRAMES).is_file():
        return
    frame_of = {name: frame for frame, name in enumerate(read_frames(path / FRAMES))}
    source = open_tracks(path / TRACKS)
    for number in range(len(source)):
        track = source[number]
        for name, points in zip(track.scan_names, track.scans, strict=True):
            if name in frame_of:
                yield frame_of[name], track.name, points
