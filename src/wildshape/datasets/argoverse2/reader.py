# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Argoverse 2 (sensor) as it lies on disk: labelled boxes and LiDAR sweeps become tracks."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.argoverse2.log import (
    LABELS,
    Boxes,
    CityPoses,
    Lidar,
    read_boxes,
    read_city_poses,
    read_sensor_pose,
    read_sweep,
    taken_by,
)
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    crop_objects,
)
from wildshape.datasets.tracks.parts import found_in, part_name
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Sensor, Track

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


@dataclass
class Argoverse2:
    """Labelled objects of Argoverse 2's sensor data set; a part is a log.

    Attributes:
        root: a log, a split folder (`val`), or one of the two folders above.
        selection: which objects and scans; its categories are the data set's, default `VEHICLES`.
        lidar: whose points are taken; see `read_sensor_pose` for the frame of the scans.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    lidar: Lidar = "both"
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The logs' folders, as seen from `root`.

        Raises:
            BadInputError: no log with labels at or below `root`.
        """
        root = Path(self.root)
        return [part_name(log, root) for log in find_logs(root)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a log, at its end: an object may leave sight and come back.

        Raises:
            BadInputError: a file of the log is missing or corrupt.
        """
        root = Path(self.root)
        log = root if (root / LABELS).is_file() else root / part
        boxes = read_boxes(log)
        wanted = self._wanted(boxes)
        gathering = Gathering(self.selection, VLP32C, self.rejected, rays=self.rays)
        T_sensor_ego = read_sensor_pose(log, self.lidar).inverse()
        frames = _Frames(log, T_sensor_ego, read_city_poses(log), boxes, self.lidar)
        for number, stamp in enumerate(np.unique(boxes.timestamps[wanted]).tolist()):
            rows = np.flatnonzero(wanted & (boxes.timestamps == stamp)).tolist()
            objects = [frames.object(row, number) for row in rows]
            crop_objects(objects, str(stamp), partial(frames.scan, stamp), self.crop, gathering)
        yield from gathering.finished()

    def _wanted(self, boxes: Boxes) -> np.ndarray:
        wanted = np.isin(boxes.categories.astype(str), self.selection.categories or VEHICLES)
        objects = dict(zip(boxes.tracks[~wanted], boxes.categories[~wanted]))
        for category in objects.values():
            self.rejected[f"object: category {category}"] += 1
        return wanted


@dataclass(frozen=True)
class _Frames:
    """What the frames of a log share."""

    log: Path
    T_sensor_ego: SE3
    city: CityPoses
    boxes: Boxes
    lidar: Lidar

    def object(self, row: int, frame: int) -> LabelledObject:
        """A box as cut out of the sensor's scan of a frame."""
        boxes = self.boxes
        T_ego_object = boxes.T_ego_object[row]
        length, width, height = boxes.sizes[row].tolist()
        T_city_ego = self._city_pose(int(boxes.timestamps[row]))
        return LabelledObject(
            name=f"{self.log.resolve().name}_{boxes.tracks[row]}",
            last_frame=frame,
            category=str(boxes.categories[row]).lower(),
            source="Argoverse 2 sensor, labelled box",
            size=(length, width, height),
            T_sensor_object=self.T_sensor_ego @ T_ego_object,
            place=(T_city_ego @ T_ego_object).translation.numpy(),
        )

    def scan(self, stamp: int) -> FullScan | None:
        """The sweep of a frame in the sensor's frame; None if it has no file."""
        path = self.log / _SWEEPS / f"{stamp}.feather"
        if not path.is_file():
            return None
        sweep = read_sweep(path)
        sweep = sweep.part(taken_by(self.lidar, sweep.lasers))
        T_ego_lidars = (read_sensor_pose(self.log, "up"), read_sensor_pose(self.log, "down"))
        starts = self.city.ray_starts(stamp, sweep, T_ego_lidars)
        return FullScan(*map(self.T_sensor_ego.apply_numpy, (sweep.points, starts)))

    def _city_pose(self, stamp: int) -> SE3:
        if stamp not in self.city:
            raise BadInputError(
                f"{self.log}: city_SE3_egovehicle.feather has no pose for the labelled sweep "
                f"{stamp}; the two are of different logs or releases, copy the log again."
            )
        return self.city.at(stamp)


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
    raise BadInputError(
        f"{root}: expected <split>/<log>/{LABELS} of Argoverse 2's sensor data set (split train or "
        f"val; test has no labels), {found_in(root)}."
    )
