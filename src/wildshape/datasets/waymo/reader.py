# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Waymo Open Dataset, Perception v2 (parquet), as it lies on disk: labelled objects become tracks.

Scans are what the TOP LiDAR saw, first return, in its own frame at the frame's time.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    crop_objects,
    described,
)
from wildshape.datasets.tracks.parts import found_in
from wildshape.datasets.tracks.selection import Selection, measured
from wildshape.datasets.waymo.range_image import at_frame_time, points_of_pixels
from wildshape.datasets.waymo.tables import (
    COMPONENTS,
    TYPES,
    Calibration,
    Labelled,
    range_images,
    read_boxes,
    read_calibration,
    read_vehicle_poses,
)
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, Track, Turn

_SLOW_M_PER_S = 1.0  # a place in float32 is off by some millimetres
_PLACE_M = 0.1  # rays that begin so near each other have one place: they are looked at together
TOP = Sensor(kind="lidar", resolution_deg=(0.136, 0.31))
_LAYOUT = f"<root>/<split>/{{{','.join(COMPONENTS)}}}/<segment>.parquet"


@dataclass
class Waymo:
    """Labelled objects of Waymo's Perception data set; a part is a segment.

    Attributes:
        root: a split's folder, which holds `lidar`, `lidar_box`, ..., or the folder above.
        selection: which objects and scans; categories are `vehicle` (the default), `pedestrian`,
            `sign`, `cyclist`.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The segments' names, sorted.

        Raises:
            BadInputError: `root` has no split with the tables needed, or an unknown category.
        """
        _check_categories(self.selection.categories)
        find_splits(Path(self.root))
        # One that lacks another table is none to pass over: its segments are counted as damaged.
        splits = [split for split in _splits(Path(self.root)) if not _absent(split, ("lidar_box",))]
        stems = (file.stem for split in splits for file in split.glob("lidar/*.parquet"))
        return sorted(stem for stem in stems if not stem.startswith("."))

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a segment, at its end: an object may leave sight and come back.

        Raises:
            BadInputError: a table of the segment is missing or corrupt.
        """
        tables = tables_of(Path(self.root), part)
        boxes = self._wanted(read_boxes(tables["lidar_box"]))
        gathering = Gathering(self.selection, TOP, self.rejected, rays=self.rays)
        unseen = set(boxes)
        for number, frame in enumerate(frames(tables, boxes)):
            unseen.remove(frame.microseconds)
            objects = [frame.object(box, part, number) for box in frame.boxes]
            name = str(frame.microseconds)
            read = partial(frame.scan, rays=self.rays)
            crop_objects(objects, name, read, self.crop, gathering)
        for time in unseen:
            gathering.reject("scan: the frame has no range image of TOP", len(boxes[time]))
        yield from gathering.finished()

    def _wanted(self, boxes: dict[int, list[Labelled]]) -> dict[int, list[Labelled]]:
        categories = self.selection.categories or ("vehicle",)
        known = {box.token: box.category for labelled in boxes.values() for box in labelled}
        for category in known.values():
            if category not in categories:
                self.rejected[f"object: category {category}"] += 1
        kept = {t: [b for b in found if b.category in categories] for t, found in boxes.items()}
        return {time: labelled for time, labelled in kept.items() if labelled}


@dataclass(frozen=True)
class Frame:
    """One turn of the TOP LiDAR, with the boxes in it."""

    microseconds: int
    image: np.ndarray
    pixel_poses: np.ndarray
    calibration: Calibration
    T_world_vehicle: SE3
    boxes: list[Labelled]

    def object(self, box: Labelled, part: str, number: int) -> LabelledObject:
        """A box as cut out of the sensor's scan."""
        return LabelledObject(
            name=f"{part}_{box.token}",
            last_frame=number,
            category=box.category,
            source=described("Waymo Open Dataset", box.size),
            size=box.size,
            T_sensor_object=self.calibration.T_vehicle_sensor.inverse() @ box.T_vehicle_object,
            place=(self.T_world_vehicle @ box.T_vehicle_object).translation.numpy(),
        )

    def scan(self, *, rays: bool = False) -> FullScan:
        """All points in the sensor's frame at the frame's time; if asked, all rays, too."""
        if not rays:
            return FullScan(self.points())
        ranges = self.image[..., 0]
        points, origins = self._rays(ranges)
        seen = (ranges > 0) & (ranges < np.inf)
        ends, starts = self._rays(np.where(seen, 0.0, 1.0))
        return FullScan(points, _places(np.concatenate((origins, starts))), lost=ends - starts)

    def turn(self, velocity: Float[np.ndarray, "3"]) -> Turn:
        """All points in the sensor's frame at the frame's time, and where their rays began.

        Pixels have poses and no times: how far the sensor had come tells when they were met.

        Args:
            velocity: of the sensor, in its frame, metres a second.
        """
        points, origins = self._rays(self.image[..., 0])
        speed = float(np.linalg.norm(velocity))
        met = origins @ (velocity / speed**2) if speed > _SLOW_M_PER_S else None
        return Turn(points, origins=_places(origins), met=met)

    def points(self) -> Points:
        """All points `(n, 3)` in the sensor's frame at the frame's time, metres."""
        moved = self._moved(*self._pixels(self.image[..., 0]))
        return moved[measured(moved)].astype(np.float32)

    def _rays(self, ranges: np.ndarray) -> tuple[Points, Points]:
        """The points of some ranges, and where the sensor was when it took each of them."""
        points, poses = self._pixels(ranges)
        moved, starts = (self._moved(one, poses) for one in (points, np.zeros_like(points)))
        kept = measured(moved)
        return moved[kept].astype(np.float32), starts[kept].astype(np.float32)

    def _pixels(self, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        T_vehicle_sensor = self.calibration.T_vehicle_sensor
        inclinations = self.calibration.inclinations(len(ranges))
        seen, points = points_of_pixels(ranges, inclinations, T_vehicle_sensor)
        return points, self.pixel_poses[seen]

    def _moved(self, points: np.ndarray, poses: np.ndarray) -> np.ndarray:
        return at_frame_time(points, poses, self.calibration.T_vehicle_sensor, self.T_world_vehicle)


def _places(origins: Points) -> Points:
    return np.rint(origins / _PLACE_M).astype(np.float32) * np.float32(_PLACE_M)


def frames(tables: dict[str, Path], boxes: dict[int, list[Labelled]]) -> Iterator[Frame]:
    """The frames of a segment that have boxes, in time order, one held at a time.

    `boxes`: by time in microseconds.

    Raises:
        BadInputError: a table is missing or corrupt, or they are not of one segment.
    """
    calibration = read_calibration(tables["lidar_calibration"])
    T_world_vehicle = read_vehicle_poses(tables["vehicle_pose"])
    unknown = boxes.keys() - T_world_vehicle.keys()
    if unknown:
        raise _of_other_time(tables["lidar_box"], min(unknown), "vehicle_pose")
    poses = range_images(tables["lidar_pose"], "LiDARPoseComponent")
    posed, pixel_poses = next(poses, (-1, np.zeros((0, 0, 6))))
    for time, image in range_images(tables["lidar"], "LiDARComponent"):
        if time not in boxes:
            continue
        while posed < time:
            posed, pixel_poses = next(poses, (1 << 62, pixel_poses))
        if posed != time or pixel_poses.shape != (*image.shape[:2], 6):
            raise _of_other_time(tables["lidar"], time, "lidar_pose")
        yield Frame(time, image, pixel_poses, calibration, T_world_vehicle[time], boxes[time])


def find_splits(root: Path, components: tuple[str, ...] = COMPONENTS) -> list[Path]:
    """Split folders at, or just below `root`, that have all tables needed, sorted.

    Raises:
        BadInputError: there is none.
    """
    if not root.is_dir():
        raise BadInputError(f"{root}: no such folder; expected {_LAYOUT}.")
    splits = _splits(root)
    whole = [path for path in splits if not _absent(path, components)]
    if splits and not whole:
        raise _lacking(splits[0], components)
    if not splits:
        raise _not_waymo(root)
    return whole


def _splits(root: Path) -> list[Path]:
    return [path for path in (root, *sorted(root.iterdir())) if (path / "lidar").is_dir()]


def _lacking(split: Path, components: tuple[str, ...]) -> BadInputError:
    absent = ", ".join(_absent(split, components))
    return BadInputError(f"{split}: no {absent} beside lidar; download these components.")


def _not_waymo(root: Path) -> BadInputError:
    if any(root.glob("*.tfrecord")) or any(root.glob("*/*.tfrecord")):
        return BadInputError(
            f"{root}: holds .tfrecord files, Waymo's version 1; download version 2 (parquet), the "
            f"components {', '.join(COMPONENTS)}."
        )
    return BadInputError(f"{root}: expected {_LAYOUT}, {found_in(root)}.")


def _absent(split: Path, components: tuple[str, ...]) -> list[str]:
    return [name for name in components if not (split / name).is_dir()]


def tables_of(
    root: Path, segment: str, components: tuple[str, ...] = COMPONENTS
) -> dict[str, Path]:
    """The file of each component of a segment.

    Raises:
        BadInputError: no split has all of them, none has the segment, or its split lacks some.
    """
    whole = find_splits(root, components)
    for split in (*whole, *_splits(root)):
        tables = {name: split / name / f"{segment}.parquet" for name in components}
        if tables["lidar"].is_file():
            if split not in whole:
                raise _lacking(split, components)
            return tables
    raise BadInputError(f"{root}: no segment {segment} in any split; check its name.")


def _check_categories(categories: tuple[str, ...]) -> None:
    unknown = [name for name in categories if name not in TYPES.values()]
    if unknown:
        raise BadInputError(
            f"'{unknown[0]}' is no category of Waymo; there are {', '.join(TYPES.values())}."
        )


def _of_other_time(path: Path, time: int, other: str) -> BadInputError:
    return BadInputError(
        f"{path}: frame {time} has no counterpart of its size in {other}/{path.name}; download "
        "both again, from one release."
    )
