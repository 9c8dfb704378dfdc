# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Argoverse 2 (sensor) as it lies on disk: labelled boxes and LiDAR sweeps become tracks."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wildshape.datasets.argoverse2.log import (
    LABELS,
    Boxes,
    Lidar,
    read_boxes,
    read_city_poses,
    read_sensor_pose,
    read_sweep,
    taken_by,
)
from wildshape.datasets.tracks.box_crop import Crop, points_in_box
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, Track

VLP32C = Sensor(kind="lidar", resolution_deg=(0.2, 0.33))
VEHICLES = (
    "REGULAR_VEHICLE",
    "LARGE_VEHICLE",
    "BUS",
    "SCHOOL_BUS",
    "BOX_TRUCK",
    "TRUCK",
    "TRUCK_CAB",
    "VEHICULAR_TRAILER",
)
"""The rigid ones: articulated buses and trains bend."""
_SWEEPS = "sensors/lidar"
_SOURCE = "Argoverse 2 sensor, labelled box"


@dataclass
class Argoverse2:
    """Labelled objects of Argoverse 2's sensor data set; a part is a log.

    Attributes:
        root: a log, a split folder (`val`), or one of the two folders above.
        selection: which objects and scans; its categories are the data set's, default `VEHICLES`.
        crop: how much around the labelled box belongs to the object.
        lidar: whose points are taken; see `read_sensor_pose` for the frame of the scans.
        rejected: see `Source`.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    lidar: Lidar = "both"
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The logs' folders, as seen from `root`.

        Raises:
            BadInputError: no log with labels at or below `root`.
        """
        root = Path(self.root)
        return [_part(log, root) for log in find_logs(root)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a log, at its end: an object may leave sight and come back.

        Raises:
            BadInputError: a file of the log is missing or corrupt.
        """
        root = Path(self.root)
        log = root if (root / LABELS).is_file() else root / part
        boxes = read_boxes(log)
        wanted = self._wanted(boxes)
        gathering = Gathering(self.selection, VLP32C)
        frames = _Frames(log, read_sensor_pose(log, self.lidar), read_city_poses(log), boxes)
        for number, stamp in enumerate(np.unique(boxes.timestamps[wanted]).tolist()):
            rows = np.flatnonzero(wanted & (boxes.timestamps == stamp))
            self._crop_frame(frames, stamp, number, rows, gathering)
        yield from gathering.finished()
        for reason, count in gathering.rejected.items():
            self.rejected[reason] += count

    def _wanted(self, boxes: Boxes) -> np.ndarray:
        wanted = np.isin(boxes.categories.astype(str), self.selection.categories or VEHICLES)
        objects = dict(zip(boxes.tracks[~wanted], boxes.categories[~wanted]))
        for category in objects.values():
            self.rejected[f"object: category {category}"] += 1
        return wanted

    def _crop_frame(
        self, frames: "_Frames", stamp: int, number: int, rows: np.ndarray, to: Gathering
    ) -> None:
        boxes, log = frames.boxes, frames.log
        active = []
        for row in rows.tolist():
            category = str(boxes.categories[row]).lower()
            if to.wants(_name(log, boxes, row), number, category=category, source=_SOURCE):
                active.append(row)
        sweep = log / _SWEEPS / f"{stamp}.feather"
        if active and not sweep.is_file():
            self.rejected["scan: the frame has no LiDAR file"] += len(active)
        elif active:
            try:
                points, lasers = read_sweep(sweep)
            except BadInputError as damage:
                to.miss(len(active), damage)
                return
            points = points[taken_by(self.lidar, lasers)]
            self._crop_sweep(frames, int(sweep.stem), points, active, to)

    def _crop_sweep(
        self, frames: "_Frames", stamp: int, points: Points, rows: list[int], to: Gathering
    ) -> None:
        T_sensor_ego = frames.T_ego_sensor.inverse()
        cloud = T_sensor_ego.apply_numpy(points)
        T_city_ego = frames.city_pose(stamp)
        boxes = frames.boxes
        for row in rows:
            T_ego_object = boxes.T_ego_object[row]
            T = T_sensor_ego @ T_ego_object
            length, width, height = boxes.sizes[row].tolist()
            to.add(
                _name(frames.log, boxes, row),
                str(stamp),
                points_in_box(cloud, T, (length, width, height), self.crop),
                T,
                (T_city_ego @ T_ego_object).translation.numpy(),
            )


@dataclass(frozen=True)
class _Frames:
    """What the frames of a log share."""

    log: Path
    T_ego_sensor: SE3
    T_city_ego: dict[int, SE3]
    boxes: Boxes

    def city_pose(self, stamp: int) -> SE3:
        if stamp not in self.T_city_ego:
            raise BadInputError(
                f"{self.log}: city_SE3_egovehicle.feather has no pose for the labelled sweep "
                f"{stamp}; the two are of different logs or releases, copy the log again."
            )
        return self.T_city_ego[stamp]


def find_logs(root: Path) -> list[Path]:
    """Folders with labels at, or one to three levels below `root`, sorted.

    Raises:
        BadInputError: there is none.
    """
    if not root.is_dir():
        raise BadInputError(
            f"{root}: no such folder; give a log of Argoverse 2's sensor data set, its split or "
            "the folder above."
        )
    for level in ("", "*/", "*/*/", "*/*/*/"):
        logs = sorted(path.parent for path in root.glob(f"{level}{LABELS}"))
        if logs:
            return logs
    found = sorted(path.name for path in root.iterdir())
    raise BadInputError(
        f"{root}: expected <split>/<log>/{LABELS} of Argoverse 2's sensor data set (split train or "
        f"val; test has no labels), found {', '.join(found[:5]) or 'an empty folder'}."
    )


def _part(log: Path, root: Path) -> str:
    return log.name if log == root else log.relative_to(root).as_posix()


def _name(log: Path, boxes: Boxes, row: int) -> str:
    return f"{log.resolve().name}_{boxes.tracks[row]}"
