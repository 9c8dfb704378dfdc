# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Segments of the Waymo Open Dataset: first returns of the TOP LiDAR, at each frame's own time."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.datasets.waymo.reader import Frame, frames, tables_of
from wildshape.datasets.waymo.tables import WITHOUT_LABELS, read_calibration, read_vehicle_poses
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Turn


class _Reader:
    """Goes through a segment's frames: its tables are read from the start on alone."""

    def __init__(self, root: Path, segment: str) -> None:
        self.tables = tables_of(root, segment, WITHOUT_LABELS)
        self.times = tuple(read_vehicle_poses(self.tables["vehicle_pose"]))
        self.restart()

    def restart(self) -> None:
        """Go back to the first frame."""
        self.frames: Iterator[Frame] = frames(self.tables, {time: [] for time in self.times})
        self.current = next(self.frames, None)

    def at(self, microseconds: int) -> Frame | None:
        """The frame of a time; None where it has no range image."""
        if self.current is None or microseconds < self.current.microseconds:
            self.restart()
        while self.current is not None and self.current.microseconds < microseconds:
            self.current = next(self.frames, None)
        there = self.current is not None and self.current.microseconds == microseconds
        return self.current if there else None


_reader = lru_cache(maxsize=1)(_Reader)


@dataclass(frozen=True)
class _Frames:
    """Reads a frame of a segment."""

    root: Path
    segment: str
    times: tuple[int, ...]
    T_world_sensor: SE3

    def __call__(self, frame: int) -> Turn:
        found = _reader(self.root, self.segment).at(self.times[frame])
        if found is None:
            return Turn(np.empty((0, 3), np.float32))
        return found.turn(self._velocity(frame))

    def _velocity(self, frame: int) -> Float[np.ndarray, "3"]:
        """Of the sensor, in its frame, metres a second."""
        before, after = max(frame - 1, 0), min(frame + 1, len(self.times) - 1)
        places = self.T_world_sensor.translation.numpy()
        since = (self.times[after] - self.times[before]) / 1e6
        moved = self.T_world_sensor.rotation[frame].numpy().T @ (places[after] - places[before])
        return moved / since if since else np.zeros(3)


def find_segments(root: Path) -> list[Path]:
    """The segments of a split's folder or of those in a folder, as paths below it."""
    files = (file for level in ("", "*/") for file in root.glob(f"{level}lidar/*.parquet"))
    return sorted(root / file.stem for file in files if not file.name.startswith("."))


def open_segment(path: Path) -> Drive:
    """One segment, by its name below the folder.

    Raises:
        BadInputError: a table of the segment is missing or corrupt.
        MissingExtraError: pyarrow is not installed.
    """
    tables = tables_of(path.parent, path.name, WITHOUT_LABELS)
    T_vehicle_sensor = read_calibration(tables["lidar_calibration"]).T_vehicle_sensor
    T_world_vehicle = read_vehicle_poses(tables["vehicle_pose"])
    times = tuple(T_world_vehicle)
    if not times:
        raise BadInputError(f"{tables['vehicle_pose']}: holds no poses; copy it again.")
    T_world_sensor = stack(list(T_world_vehicle.values())) @ T_vehicle_sensor
    return Drive.of(
        name=path.name,
        path=path,
        scan_names=[str(time) for time in times],
        read=_Frames(path.parent, path.name, times, T_world_sensor),
        times=[time / 1e6 for time in times],
        T_world_sensor=T_world_sensor,
        files=tables.values(),
    )
