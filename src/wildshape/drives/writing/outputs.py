# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a drive leaves in its folder for others: boxes, trajectory, tracks, completed shapes."""

import csv
import io
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from wildshape.drives.completing.boxes import Way
from wildshape.drives.completing.completion import CATEGORY
from wildshape.drives.completing.level_frame import (
    Completed,
    boxes_in_scans,
    on_ground_of_each,
)
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import BoxConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.rays import RayCutter
from wildshape.drives.writing.folder import SHAPES, TRACKS, TRAJECTORY, TUM
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.complete_folder import COMPLETED, OBJECTS
from wildshape.io.atomic import naming, write_text
from wildshape.io.boxes.detections import detections_of, pose_of
from wildshape.io.boxes.table import BoxRow
from wildshape.io.guard import read_json
from wildshape.io.poses import write_poses, write_tum
from wildshape.io.rays import rays_bytes
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import file_names, write_track
from wildshape.records import Box


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of a drive.

    Attributes:
        completed: its shape's place and size.
        way: its boxes in the level world.
        confidence: 0 to 1.
    """

    completed: Completed
    way: Way
    confidence: float

    @property
    def name(self) -> str:
        """That of its folders."""
        return self.completed.seen.name


def write_trajectories(out: Path, drive: Drive, T_world_sensor: SE3) -> None:
    """`trajectory.txt` and `trajectory.tum`; without times, time is counted in scans."""
    write_tum(out / TUM, T_world_sensor, drive.times or drive.ticks)
    write_poses(out / TRAJECTORY, T_world_sensor)


def write_frames(path: Path, drive: Drive, points: Sequence[int]) -> None:
    """Which scan each frame is; `points`: of each."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("frame", "scan", "time", "points"))
    times = drive.times or [""] * len(drive)
    table.writerows(zip(range(len(drive)), drive.scan_names, times, points, strict=True))
    write_text(path, text.getvalue())


@dataclass(frozen=True)
class RayWriter:
    """Writes the rays beside vehicles into their track folders, a frame at a time.

    Attributes:
        files: by frame: where each vehicle's go, and its clusters.
    """

    cutter: RayCutter
    files: dict[int, list[tuple[Path, tuple[int, ...]]]]

    @classmethod
    def of(cls, out: Path, vehicles: Sequence[Vehicle], drive: Drive, cuts: Path) -> "RayWriter":
        """For the vehicles whose track folders are not there yet; as `VehicleWriter`."""
        files: dict[int, list[tuple[Path, tuple[int, ...]]]] = {}
        for seen in (one.completed.seen for one in vehicles):
            track = out / TRACKS / seen.name
            if _is_written(track):
                continue
            scans = file_names([drive.scan_names[frame] for frame in seen.frames])
            for frame, rows, scan in zip(seen.frames, seen.rows, scans):
                files.setdefault(frame, []).append((track / "rays" / f"{scan}.npz", rows))
        return cls(RayCutter(drive, cuts), files)

    def __call__(self, frame: int) -> None:
        """Cut and write those of one frame; half a file is written again, for no track has it."""
        files = self.files[frame]
        found = self.cutter.in_frame(frame, [rows for _, rows in files])
        for (path, _), rays in zip(files, found):
            if rays is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                with naming(path):
                    path.write_bytes(rays_bytes(rays))


@dataclass(frozen=True)
class VehicleWriter:
    """Writes a vehicle's track, completed object and shape, as far as they are not there yet.

    Attributes:
        out: folder of the results.
        folders: of the completed objects.
        cuts: folder of the clusters.
        config: of the boxes.
    """

    out: Path
    folders: Path
    cuts: Path
    drive: Drive
    turns: Turns
    config: BoxConfig

    def __call__(self, one: Vehicle) -> list[BoxRow]:
        """The vehicle's lines of `boxes.csv`."""
        folder, track = self.folders / one.name, self.out / TRACKS / one.name
        if not _is_written(track):
            write_track(track, one.completed.seen.track(self.cuts, self.drive, CATEGORY))
        copy_object(folder, self.out / "objects" / one.name)
        write_shape(self.out / SHAPES / f"{one.name}.ply", folder, one.completed)
        return rows_of(one, self._boxes(one), self.drive)

    def _boxes(self, one: Vehicle) -> list[tuple[int, Box]]:
        """Frame and box in that frame's sensor frame, of all frames of a vehicle."""
        frames, vehicle = one.way.frames, one.completed
        shown = self.turns.shown(frames, one.way.boxes)
        placed = on_ground_of_each(frames, shown, vehicle, self.cuts, self.turns, self.config)
        T_level_sensor = self.turns.T_level_sensor[torch.tensor(frames)]
        return list(zip(frames, boxes_in_scans(placed, vehicle.size, T_level_sensor)))


def _is_written(track: Path) -> bool:
    return (track / "scans").is_dir()


def copy_object(folder: Path, target: Path) -> None:
    """A completed object from among the candidates to the results; `objects.json` comes last."""
    if (target / OBJECTS).is_file():
        return
    shutil.copytree(
        folder, target, ignore=shutil.ignore_patterns(OBJECTS, ".*"), dirs_exist_ok=True
    )
    write_text(target / OBJECTS, (folder / OBJECTS).read_text("utf-8"))


def write_shape(path: Path, folder: Path, one: Completed) -> None:
    """A vehicle's complete shape in the frame of its box: x forward, origin in the middle.

    Args:
        path: file to write.
        folder: of the completed object; all its scans have one shape.
        one: where the box was raised, and turned, since.
    """
    if path.is_file():
        return
    said = read_json(folder / OBJECTS, "what complete writes")
    first = next(detections_of(said, 0))
    points = read_points(folder / COMPLETED / f"{first.scan}.ply")
    placed = pose_of(first.box).inverse().apply_numpy(points)
    if one.turned:
        placed = placed * np.array((-1, -1, 1), placed.dtype)
    write_ply(path, placed - np.array((0.0, 0.0, one.raised_m), placed.dtype))


def rows_of(vehicle: Vehicle, boxes: list[tuple[int, Box]], drive: Drive) -> list[BoxRow]:
    """A vehicle's lines of `boxes.csv`."""
    seen = vehicle.completed.seen
    points = dict(zip(seen.frames, seen.points))
    return [
        BoxRow(
            frame,
            None if drive.times is None else drive.times[frame],
            vehicle.name,
            *box.centre,
            *box.size,
            yaw=box.yaw,
            confidence=vehicle.confidence,
            points=points.get(frame, 0),
            moving=vehicle.way.moving,
        )
        for frame, box in boxes
    ]
