# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI raw drives as they lie on disk: tracklets and velodyne scans become tracks.

Scans and tracklets share the velodyne frame (x forward, y left, z up), so no calibration is read.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.kitti.oxts import drive_poses
from wildshape.datasets.kitti.tracklets import Tracklet, read_tracklets
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    crop_objects,
    described,
)
from wildshape.datasets.tracks.parts import named, part_name
from wildshape.datasets.tracks.selection import Selection, measured
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.scans.arrays import read_rows
from wildshape.records import Points, Sensor, Track

HDL64E = Sensor(kind="lidar", resolution_deg=(0.18, 0.42))
VEHICLES = ("Car", "Van", "Truck")
_TRACKLETS = "tracklet_labels.xml"
# Full scans first; the second is how a drive cut down to its vehicles is kept.
_SCAN_FOLDERS = ("velodyne_points/data", "velodyne_objects_xyz0")


@dataclass
class KittiRaw:
    """Labelled objects of KITTI raw; a part is a drive.

    Attributes:
        root: a drive folder, a date folder or the folder above.
        selection: which objects and scans; its categories are `objectType`s, by default `VEHICLES`.
            Whether an object moves is told by the drive's GPS/IMU records, read if it is asked.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The drives' folders, as seen from `root`.

        Raises:
            BadInputError: no drive below `root`, or none with tracklets.
        """
        root = Path(self.root)
        return [part_name(drive, root) for drive in find_drives(root)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a drive, each as soon as its object is labelled no more.

        Raises:
            BadInputError: a file of the drive is missing or corrupt.
        """
        root = Path(self.root)
        drive = named(root) if _is_drive(root) else root / part
        if (drive / _TRACKLETS).is_file():
            yield from self._drive_tracks(drive)
        else:
            self.rejected[f"drive without {_TRACKLETS}"] += 1

    def _drive_tracks(self, drive: Path) -> Iterator[Track]:
        tracklets = read_tracklets(drive / _TRACKLETS)
        gathering = Gathering(self.selection, HDL64E, self.rejected, rays=self.rays)
        files = scan_files(drive)
        world = {} if self.selection.motion == "any" else drive_poses(drive)
        labelled: dict[int, dict[str, Tracklet]] = defaultdict(dict)
        for number, tracklet in enumerate(tracklets):
            if self._is_wanted(tracklet):
                for frame in tracklet.frames:
                    labelled[frame][f"{drive.name}_{number:04d}"] = tracklet
        for frame, there in sorted(labelled.items()):
            path, pose = files.get(frame), world.get(frame)
            objects = [_object(name, tracklet, frame, pose) for name, tracklet in there.items()]
            read = partial(read_velodyne, path) if path else lambda: None
            crop_objects(objects, f"{frame:010d}", read, self.crop, gathering)
            yield from gathering.finished(before=frame)
        yield from gathering.finished()

    def _is_wanted(self, tracklet: Tracklet) -> bool:
        if tracklet.category not in (self.selection.categories or VEHICLES):
            self.rejected[f"object: category {tracklet.category}"] += 1
            return False
        return True


def _object(name: str, tracklet: Tracklet, frame: int, T_world_velo: SE3 | None) -> LabelledObject:
    T = tracklet.T_velo_object[frame - tracklet.first_frame]
    place = None if T_world_velo is None else (T_world_velo @ T).translation.numpy()
    source = described("KITTI raw", tracklet.size)
    return LabelledObject(name, frame, tracklet.category.lower(), source, tracklet.size, T, place)


def find_drives(root: Path) -> list[Path]:
    """Drive folders at, one or two levels below `root`, sorted.

    Raises:
        BadInputError: there is none, or `root` is a drive without tracklets.
    """
    if not root.is_dir():
        raise BadInputError(f"{root}: no such folder; give a KITTI raw drive or a folder above.")
    if _is_drive(root):
        if not (root / _TRACKLETS).is_file():
            raise BadInputError(
                f"{root / _TRACKLETS}: no such file; KITTI's 'tracklets' archive brings it."
            )
        return [root]
    drives = [d for level in ("*", "*/*") for d in sorted(root.glob(level)) if _is_drive(d)]
    if not any((d / _TRACKLETS).is_file() for d in drives):
        raise BadInputError(
            f"{root}: found {len(drives)} KITTI raw drives and none with {_TRACKLETS}; "
            "give a drive folder, its date folder or the folder above."
        )
    return drives


def _is_drive(folder: Path) -> bool:
    return (folder / _TRACKLETS).is_file() or any((folder / f).is_dir() for f in _SCAN_FOLDERS)


def scan_files(drive: Path) -> dict[int, Path]:
    """The velodyne file of each frame that has one, full scans preferred.

    Raises:
        BadInputError: the drive has no scan at all.
    """
    files: dict[int, Path] = {}
    for folder in reversed(_SCAN_FOLDERS):
        found = (drive / folder).glob("*.bin")
        files |= {int(path.stem): path for path in found if path.stem.isdecimal()}
    if not files:
        raise BadInputError(
            f"{drive / _SCAN_FOLDERS[0]}: no .bin scans; KITTI's 'synced+rectified' archive of the "
            "drive brings them."
        )
    return files


def read_velodyne(path: Path) -> Points:
    """One whole velodyne scan `(n, 3)`, metres; no limit on its extent, unlike an object's scan.

    Raises:
        BadInputError: the file is no sequence of x y z intensity in float32.
    """
    points = read_rows(path, "x y z intensity")
    return np.ascontiguousarray(points[measured(points)])
