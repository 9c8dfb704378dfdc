# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PandaSet as it lies on disk: cuboids and sweeps of the Pandar64 become tracks."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.pandaset.scene import (
    CUBOIDS,
    FILE,
    PANDARGT,
    SWEEPS,
    Cuboids,
    Drive,
    frame_files,
    read_cuboids,
    read_drive,
    read_sweep,
)
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import Crop, rows_in_box
from wildshape.datasets.tracks.parts import found_in, part_name
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan, sight_lines
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, SightLines, Track

PANDAR64_SENSOR = Sensor(kind="lidar", resolution_deg=(0.2, 0.167))
VEHICLES = (
    "Car",
    "Pickup Truck",
    "Medium-sized Truck",
    "Semi-truck",
    "Bus",
    "Emergency Vehicle",
    "Other Vehicle - Construction Vehicle",
)
_SOURCE = "PandaSet, labelled cuboid"


@dataclass
class PandaSet:
    """Labelled objects of PandaSet; a part is a scene.

    Only points of the Pandar64 are taken. Where an object moves through the view of both LiDARs it
    is labelled twice, once for the time at which each saw it; the PandarGT's label is left out.

    Attributes:
        root: a scene, the folder of the scenes, or the folder above.
        selection: which objects and scans; its categories are the data set's, default `VEHICLES`.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The scenes' folders, as seen from `root`.

        Raises:
            BadInputError: no labelled scene at or below `root`.
        """
        root = Path(self.root)
        return [part_name(scene, root) for scene in find_scenes(root)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a scene, at its end: an object may leave sight and come back.

        Raises:
            BadInputError: a file of the scene is missing or corrupt.
        """
        root = Path(self.root)
        scene = root if _is_scene(root) else root / part
        labels = frame_files(scene / CUBOIDS)
        drive = read_drive(scene, 1 + max(labels))
        gathering = Gathering(self.selection, PANDAR64_SENSOR, self.rejected, rays=self.rays)
        left_out: dict[str, str] = {}
        for number, path in labels.items():
            cuboids = read_cuboids(path)
            rows = self._wanted(cuboids, left_out)
            self._crop_frame(_Frame(scene, number, drive, cuboids), rows, gathering)
        yield from gathering.finished()
        for reason in left_out.values():
            self.rejected[reason] += 1

    def _wanted(self, cuboids: Cuboids, left_out: dict[str, str]) -> list[int]:
        """Rows to take; why an object is not taken is noted under its name."""
        rows = []
        for row, (name, category) in enumerate(zip(cuboids.tracks, cuboids.categories)):
            if category not in (self.selection.categories or VEHICLES):
                left_out[name] = f"object: category {category}"
            elif cuboids.sensors[row] == PANDARGT:
                left_out[name] = "object: the PandarGT's label of an object that has two"
            else:
                rows.append(row)
        return rows

    def _crop_frame(self, frame: "_Frame", rows: list[int], to: Gathering) -> None:
        cuboids = frame.cuboids
        active = []
        for row in rows:
            category = str(cuboids.categories[row]).lower()
            if to.wants(frame.track(row), frame.number, category=category, source=_SOURCE):
                active.append(row)
        read = partial(read_sweep, frame.sweep) if frame.sweep.is_file() else lambda: None
        swept = to.read(read, len(active))
        if swept is not None:
            self._crop_sweep(frame, active, *swept, to)

    def _crop_sweep(
        self, frame: "_Frame", rows: list[int], cloud: Points, times: np.ndarray, to: Gathering
    ) -> None:
        for row in rows:
            T_world_object = frame.cuboids.T_world_object[row]
            length, width, height = frame.cuboids.sizes[row].tolist()
            inside = rows_in_box(cloud, T_world_object, (length, width, height), self.crop)
            # The sensor stands where it was when its beams passed the object.
            time = float(times[inside].mean()) if len(inside) else frame.drive.stamps[frame.number]
            T_sensor_world = frame.drive.sensor_pose(frame.number, time).inverse()
            to.add(
                frame.track(row),
                frame.sweep.name.removesuffix(FILE),
                T_sensor_world.apply_numpy(cloud[inside]),
                T_sensor_world @ T_world_object,
                T_world_object.translation.numpy(),
                rays=partial(_rays, cloud, inside, T_sensor_world),
                label_size_m=(length, width, height),
            )


def _rays(cloud: Points, rows: np.ndarray, T_sensor_world: SE3) -> SightLines | None:
    """The rays that passed an object by, seen from where the sensor was then."""
    return sight_lines(FullScan(T_sensor_world.apply_numpy(cloud)), rows)


@dataclass(frozen=True)
class _Frame:
    """A frame of a scene: its labels and where its sweep lies."""

    scene: Path
    number: int
    drive: Drive
    cuboids: Cuboids

    @property
    def sweep(self) -> Path:
        return self.scene / SWEEPS / f"{self.number:02d}{FILE}"

    def track(self, row: int) -> str:
        return f"{self.scene.resolve().name}_{self.cuboids.tracks[row]}"


def find_scenes(root: Path) -> list[Path]:
    """Labelled scenes at, or one or two levels below `root`, sorted.

    Raises:
        BadInputError: there is none.
    """
    if not root.is_dir():
        raise BadInputError(
            f"{root}: no such folder; give a scene of PandaSet or the folder of its scenes."
        )
    for level in ("", "*/", "*/*/"):
        scenes = sorted(path.parents[1] for path in root.glob(f"{level}{CUBOIDS}"))
        if any(map(_is_scene, scenes)):
            return [scene for scene in scenes if _is_scene(scene)]
    raise BadInputError(
        f"{root}: expected PandaSet's <scene>/{CUBOIDS}/00{FILE} and <scene>/{SWEEPS}, "
        f"{found_in(root)}."
    )


def _is_scene(folder: Path) -> bool:
    return (folder / CUBOIDS).is_dir() and (folder / SWEEPS).is_dir()
