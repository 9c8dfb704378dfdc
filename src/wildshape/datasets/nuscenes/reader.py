# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""nuScenes as it lies on disk: tables and LIDAR_TOP's sweeps become tracks.

Scans keep LIDAR_TOP's own frame (x right, y forward, z up): points are rows of the user's files.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from wildshape.datasets.nuscenes.json_rows import json_rows
from wildshape.datasets.nuscenes.scene import Frame, Labelled, Scene, read_scene
from wildshape.datasets.nuscenes.table_index import CHANNELS, cache_folder, index_of, lidar_of
from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    crop_objects,
    described,
)
from wildshape.datasets.tracks.parts import found_in, named
from wildshape.datasets.tracks.selection import Selection, measured
from wildshape.errors import BadInputError
from wildshape.io.guard import read_json
from wildshape.io.scans.arrays import read_rows
from wildshape.io.scans.points import read_points
from wildshape.records import Points, Sensor, Track

HDL32E = Sensor(kind="lidar", resolution_deg=(0.33, 1.33))
VEHICLES = ("car", "truck", "bus", "trailer", "construction", "emergency")
VEHICLES += ("other_vehicle", "emergency_vehicle")  # Lyft's
"""Parts of category names: vehicle.car, vehicle.bus.rigid, ...; no two-wheelers."""
_LAYOUT = f"<root>/v1.0-trainval/scene.json, ... and <root>/samples/{CHANNELS[0]}/*.pcd.bin"
_TABLES = ("v1.*", "data", "train_data", "annotation")  # nuScenes, TruckScenes, Lyft, T4
_TOKEN_LETTERS = 12
_COLUMNS = ("x", "y", "z", "intensity", "ring")
_FEWEST, _MOST = 4, 64  # numbers of a point


@dataclass
class NuScenes:
    """Labelled objects of nuScenes; a part is a scene.

    Attributes:
        root: the folder with `v1.0-*`, `samples` and `sweeps`, or one of its `v1.0-*` folders.
        selection: which objects and scans; categories are words of the data set's dotted names
            (`vehicle.bus.rigid`, `bus` or `bus.rigid`), default `VEHICLES`.
        sweeps: also take the 20 Hz sweeps between the 2 Hz key frames; boxes are interpolated.
        lidar: channel of the LiDAR; default: the first of `CHANNELS` that there is.
        cache: where the index of the tables is kept; default `table_index.cache_folder()`.
        rays: with each scan keep the rays of its frame that passed the object by, too.
    """

    root: Path
    selection: Selection = Selection()
    crop: Crop = Crop()
    sweeps: bool = False
    lidar: str = ""
    cache: Path | None = None
    rays: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """The scenes' names, sorted.

        Raises:
            BadInputError: `root` is no nuScenes, or several releases of it.
        """
        tables = find_tables(Path(self.root))
        channel = lidar_of(tables, self.lidar)
        beside = (f"samples/{channel}", "lidar", "train_lidar", f"data/{channel}")
        if not any((tables.parent / folder).is_dir() for folder in beside):
            raise BadInputError(
                f"{tables.parent}: expected samples/{channel} beside {tables.name}, "
                f"{found_in(tables.parent)}; unpack the data set's file blobs there."
            )
        labels = tables / "sample_annotation.json"
        if next(json_rows(labels), None) is None:
            raise BadInputError(f"{labels}: no labels (v1.0-test has none); give another release.")
        return sorted(str(row.get("name")) for row in json_rows(tables / "scene.json"))

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks of a scene, at its end: an object may leave sight and come back.

        Raises:
            BadInputError: a table or a sweep is missing or corrupt.
        """
        tables = find_tables(Path(self.root))
        channel = lidar_of(tables, self.lidar)
        with index_of(tables, self.cache or cache_folder(), channel) as db:
            scene = read_scene(db, part, sweeps=self.sweeps)
        if not any(file_of(tables, frame).is_file() for frame in scene.frames):
            self.rejected[f"scene: none of its {channel} files is here"] += 1
            return
        sensor = HDL32E if channel == CHANNELS[0] else Sensor("lidar")
        gathering = Gathering(self.selection, sensor, self.rejected, rays=self.rays)
        wanted = self._wanted(scene)
        for number, frame in enumerate(scene.frames):
            objects = [
                self._object(wanted[token], box, frame, number)
                for token, box in scene.boxes_at(frame).items()
                if token in wanted
            ]
            read = partial(read_sweep, file_of(tables, frame), info_of(tables, frame))
            crop_objects(objects, frame.name, read, self.crop, gathering)
        yield from gathering.finished()

    def _wanted(self, scene: Scene) -> dict[str, tuple[str, str]]:
        """Name and category of the objects to be taken, by token."""
        short = {token[:_TOKEN_LETTERS] for token in scene.categories}
        alike = len(short) < len(scene.categories)  # tokens of one's own may begin alike
        wanted = {}
        for token, category in scene.categories.items():
            if _is_of(category, self.selection.categories or VEHICLES):
                name = f"{scene.name}_{token if alike else token[:_TOKEN_LETTERS]}"
                wanted[token] = (name, category.removeprefix("vehicle."))
            else:
                self.rejected[f"object: category {category}"] += 1
        return wanted

    def _object(
        self, named: tuple[str, str], box: Labelled, frame: Frame, number: int
    ) -> LabelledObject:
        name, category = named
        source = described("nuScenes", box.size)
        return LabelledObject(
            name=name,
            last_frame=number,
            category=category,
            source=f"{source}, interpolated between key frames" if self.sweeps else source,
            size=box.size,
            T_sensor_object=frame.T_global_sensor.inverse() @ box.T_global_object,
            place=box.T_global_object.translation.numpy(),
        )


def file_of(tables: Path, frame: Frame) -> Path:
    """A frame's file: Lyft's lie in train_lidar, its tables say lidar."""
    path = tables.parent / frame.file
    renamed = tables.parent / f"train_{frame.file}"
    return renamed if not path.is_file() and renamed.is_file() else path


def find_tables(root: Path) -> Path:
    """The folder of the tables, at or just below `root`.

    Raises:
        BadInputError: there is none, or there are several.
    """
    if (root / "scene.json").is_file():
        return named(root)
    if not root.is_dir():
        raise BadInputError(f"{root}: no such folder; expected {_LAYOUT}.")
    found = [path.parent for name in _TABLES for path in sorted(root.glob(f"{name}/scene.json"))]
    if not found:
        raise BadInputError(f"{root}: expected {_LAYOUT}, {found_in(root)}.")
    if len(found) > 1:
        raise BadInputError(
            f"{root}: holds {' and '.join(path.name for path in found)}, which may share scenes; "
            f"give one of them, for example {found[-1]}."
        )
    return found[0]


def info_of(tables: Path, frame: Frame) -> Path | None:
    """The file that says how many numbers a point of a frame has, if there is one."""
    path = tables.parent / frame.info
    return path if path.is_file() else None


def read_sweep(path: Path, info: Path | None = None) -> Points:
    """One whole sweep `(n, 3)`, metres, in the frame of LIDAR_TOP; `info` as of `info_of`.

    Raises:
        BadInputError: the file is missing or no sequence of x y z intensity ring in float32, or
            of as many numbers as `info` says.
    """
    if not path.is_file():
        raise BadInputError(
            f"{path}: no such file; unpack the blob of nuScenes that brings it (sweeps/ comes with "
            "the sweeps of the LiDAR, samples/ with the key frames)."
        )
    if path.suffix == ".pcd":  # TruckScenes
        points = read_points(path)
        return points[measured(points)]
    points = read_rows(path, _columns(info) if info else " ".join(_COLUMNS))
    return np.ascontiguousarray(points[measured(points)])


def _columns(info: Path) -> str:
    count = read_json(info, "a scan's JSON object", dict).get("num_pts_feats", len(_COLUMNS))
    if not isinstance(count, int) or not _FEWEST <= count <= _MOST:
        raise BadInputError(
            f"{info}: num_pts_feats is {str(count)[:40]}, expected {_FEWEST} to {_MOST}: how many"
            " float32 a point has in the scan's file."
        )
    return " ".join([*_COLUMNS, *["more"] * count][:count])


def _is_of(category: str, words: tuple[str, ...]) -> bool:
    return any(f".{word}." in f".{category}." for word in words)
