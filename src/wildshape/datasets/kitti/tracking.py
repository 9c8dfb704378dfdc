# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI tracking as it lies on disk: labelled boxes and velodyne scans become tracks."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.kitti.calibration import read_calibration, rigid
from wildshape.datasets.kitti.oxts import read_oxts
from wildshape.datasets.kitti.raw import HDL64E, read_velodyne
from wildshape.datasets.kitti.tracking_labels import CATEGORIES, LabelledBox, read_boxes
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    crop_objects,
    described,
)
from wildshape.datasets.tracks.parts import found_in, numbered
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError, SharedInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Track

VEHICLES = ("Car", "Van", "Truck")
_LABELS, _SCANS, _CALIBRATION, _OXTS = "label_02", "velodyne", "calib", "oxts"


@dataclass
class KittiTracking:
    """Labelled objects of KITTI tracking; a part is a sequence.

    Attributes:
        root: the folder above `training`, or `training` (the testing half has no labels).
        selection: which objects and scans; categories are the labels' types, by default `VEHICLES`.
            Whether an object moves is known where `oxts` lies beside the labels.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The sequences that have labels.

        Raises:
            BadInputError: there is none.
        """
        labels = self._training() / _LABELS
        found = sorted(path.stem for path in labels.glob("*.txt") if path.stem.isdigit())
        if not found:
            raise BadInputError(f"{labels}: no labels; KITTI tracking's label archive brings them.")
        return found

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a sequence, each right after the last frame that labels its object.

        Raises:
            BadInputError: a file of the sequence is missing or corrupt.
        """
        sequence = _open(self._training(), part)
        frames = self._wanted(sequence.labels)
        last = {box.track: box.frame for boxes in frames.values() for box in boxes}
        gathering = Gathering(self.selection, HDL64E, self.rejected, rays=self.rays)
        for frame, boxes in frames.items():
            # The last frame is known: an object may be unlabelled for a while and come back.
            objects = [sequence.object(box, last[box.track]) for box in boxes]
            path = sequence.scans.get(frame)
            read = partial(read_velodyne, path) if path else lambda: None
            crop_objects(objects, f"{frame:06d}", read, self.crop, gathering)
            yield from gathering.finished(before=frame + 1)
        yield from gathering.finished()  # nothing is left; says so if no file could be read

    def _training(self) -> Path:
        root = Path(self.root)
        for folder in (root / "training", root):
            if (folder / _LABELS).is_dir():
                return folder
        raise BadInputError(
            f"{root}: {found_in(root)}; give KITTI tracking's folder with training/{_LABELS}"
            " in it, or training."
        )

    def _wanted(self, labels: list[LabelledBox]) -> dict[int, list[LabelledBox]]:
        """The boxes of the categories asked for, by frame, in order of frames."""
        categories = self.selection.categories or VEHICLES
        unknown = [name for name in categories if name not in CATEGORIES]
        if unknown:
            raise SharedInputError(
                f"'{unknown[0]}' is no type of KITTI tracking; there are {', '.join(CATEGORIES)}."
            )
        others = {box.track: box.category for box in labels if box.category not in categories}
        for category in others.values():
            self.rejected[f"object: category {category}"] += 1
        frames: dict[int, list[LabelledBox]] = defaultdict(list)
        for box in sorted(labels, key=lambda box: box.frame):
            if box.category in categories:
                frames[box.frame].append(box)
        return frames


@dataclass(frozen=True)
class _Sequence:
    """An opened sequence.

    Attributes:
        scans: the velodyne file of each frame that has one.
        T_velo_rect: from the rectified camera frame of the labels to the velodyne's.
        T_world_velo: one pose a frame; None where there is no GPS/IMU record.
    """

    name: str
    labels: list[LabelledBox]
    scans: dict[int, Path]
    T_velo_rect: SE3
    T_world_velo: SE3 | None

    def object(self, box: LabelledBox, last_frame: int) -> LabelledObject:
        """A box as cut out of the velodyne's scan."""
        T_velo_object = self.T_velo_rect @ box.T_rect_object
        return LabelledObject(
            name=f"{self.name}_{box.track:04d}",
            last_frame=last_frame,
            category=box.category.lower(),
            source=described("KITTI tracking", box.size),
            size=box.size,
            T_sensor_object=T_velo_object,
            place=self._place(box.frame, T_velo_object),
        )

    def _place(self, frame: int, T_velo_object: SE3) -> np.ndarray | None:
        """Where an object stands in the world, `(3,)` metres, if that is known."""
        if self.T_world_velo is None:
            return None
        if frame >= len(self.T_world_velo):
            raise BadInputError(
                f"{_OXTS}/{self.name}.txt: {len(self.T_world_velo)} lines, but the labels know a "
                f"frame {frame}; download KITTI tracking's GPS/IMU data again."
            )
        return (self.T_world_velo[frame] @ T_velo_object).translation.numpy()


def _open(training: Path, name: str) -> _Sequence:
    path = training / _CALIBRATION / f"{name}.txt"
    calibration = read_calibration(path, "KITTI tracking's calibration archive brings it")
    T_camera_velo = rigid(calibration, ("Tr_velo_to_cam", "Tr_velo_cam"), path)
    T_rect_camera = rigid(calibration, ("R0_rect", "R_rect"), path)
    oxts, T_world_velo = training / _OXTS / f"{name}.txt", None
    if oxts.is_file():
        T_velo_imu = rigid(calibration, ("Tr_imu_to_velo", "Tr_imu_velo"), path)
        T_world_velo = read_oxts(oxts) @ T_velo_imu.inverse()
    return _Sequence(
        name=name,
        labels=read_boxes(training / _LABELS / f"{name}.txt"),
        scans=numbered(
            training / _SCANS / name,
            ".bin",
            "no .bin scans; KITTI tracking's velodyne archive brings them",
        ),
        T_velo_rect=(T_rect_camera @ T_camera_velo).inverse(),
        T_world_velo=T_world_velo,
    )
