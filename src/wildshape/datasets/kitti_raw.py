# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI raw drives as they lie on disk: tracklets and velodyne scans become tracks.

Scans and tracklets share the velodyne frame (x forward, y left, z up), so no calibration is read.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wildshape.datasets.tracklets import Tracklet, read_tracklets
from wildshape.errors import BadInputError
from wildshape.geometry.se3 import stack
from wildshape.records import Points, Sensor, Track

HDL64E = Sensor(kind="lidar", resolution_deg=(0.18, 0.42))
_TRACKLETS = "tracklet_labels.xml"
# Full scans first; the second is how a drive cut down to its vehicles is kept.
_SCAN_FOLDERS = ("velodyne_points/data", "velodyne_objects_xyz0")
_Crop = tuple[int, Points]


@dataclass
class KittiRaw:
    """Vehicles of KITTI raw.

    Attributes:
        root: a drive folder, a date folder or the folder above.
        every: take every k-th labelled frame of an object.
        min_points: a scan with fewer points on the object is left out (METHOD 2).
        min_scans: an object with fewer scans is left out.
        categories: the `objectType`s taken.
        margin: the labelled box is enlarged by this, metres; labels are good to 5 cm.
        keep_ground: keep the points below `ground`, and those just under the box's floor.
        ground: height of the strip above the box's floor that is left out otherwise, metres.
        rejected: see `Source`.
    """

    root: Path
    every: int = 1
    min_points: int = 100
    min_scans: int = 1
    categories: tuple[str, ...] = ("Car", "Van", "Truck")
    margin: float = 0.15
    keep_ground: bool = False
    ground: float = 0.2
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def tracks(self) -> Iterator[Track]:
        """Tracks drive by drive, in the order of the tracklets; only one drive is held at a time.

        Raises:
            BadInputError: no drive below `root`, or a file of one is missing or corrupt.
        """
        self.rejected = Counter()
        for drive in find_drives(Path(self.root)):
            if (drive / _TRACKLETS).is_file():
                yield from self._drive_tracks(drive)
            else:
                self.rejected[f"drive without {_TRACKLETS}"] += 1

    def _drive_tracks(self, drive: Path) -> Iterator[Track]:
        tracklets = read_tracklets(drive / _TRACKLETS)
        files = scan_files(drive)
        wanted = {i: t for i, t in enumerate(tracklets) if self._is_wanted(t)}
        crops: dict[int, list[_Crop]] = {i: [] for i in wanted}
        for frame in range(max((t.frames.stop for t in wanted.values()), default=0)):
            active = {i: t for i, t in wanted.items() if frame in t.frames[:: self.every]}
            self._crop_frame(active, frame, files, crops)
        for i, tracklet in wanted.items():
            if len(crops[i]) >= self.min_scans:
                yield _track(f"{drive.name}_{i:04d}", tracklet, crops[i])
            else:
                self.rejected[f"object: fewer than {self.min_scans} scans left"] += 1

    def _is_wanted(self, tracklet: Tracklet) -> bool:
        if tracklet.category not in self.categories:
            self.rejected[f"object: category {tracklet.category}"] += 1
            return False
        return True

    def _crop_frame(
        self,
        active: dict[int, Tracklet],
        frame: int,
        files: dict[int, Path],
        crops: dict[int, list[_Crop]],
    ) -> None:
        if not active:
            return
        if frame not in files:
            self.rejected["scan: the frame has no velodyne file"] += len(active)
            return
        cloud = read_velodyne(files[frame])
        ground = -self.margin if self.keep_ground else self.ground
        for i, tracklet in active.items():
            points = tracklet.crop(cloud, frame, self.margin, ground)
            if len(points) >= self.min_points:
                crops[i].append((frame, points))
            else:
                self.rejected[f"scan: fewer than {self.min_points} points on the object"] += 1


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
        files |= {int(path.stem): path for path in found if path.stem.isdigit()}
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
    raw = np.fromfile(path, dtype="<f4")
    if path.stat().st_size % 16 or len(raw) == 0:
        raise BadInputError(
            f"{path}: {path.stat().st_size} bytes, expected a multiple of 16 (float32 x y z "
            "intensity); the file is truncated, download it again."
        )
    points = raw.reshape(-1, 4)[:, :3]
    return np.ascontiguousarray(points[np.isfinite(points).all(axis=1)], dtype=np.float32)


def _track(name: str, tracklet: Tracklet, crops: list[_Crop]) -> Track:
    frames = [frame for frame, _ in crops]
    length, width, height = tracklet.size
    return Track(
        name=name,
        scans=tuple(points for _, points in crops),
        scan_names=tuple(f"{frame:010d}" for frame in frames),
        sensor=HDL64E,
        category=tracklet.category.lower(),
        source=f"KITTI raw, labelled box {length:.2f} x {width:.2f} x {height:.2f} m",
        T_sensor_object=stack([tracklet.T_velo_object[f - tracklet.first_frame] for f in frames]),
    )
