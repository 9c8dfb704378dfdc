# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scenes of PandaSet: the sweeps of the Pandar64, its own axes, x forward, y left, z up."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.datasets.pandaset.scene import (
    FILE,
    SWEEPS,
    frame_files,
    read_drive,
    read_sweep,
)
from wildshape.datasets.pandaset.scene import Drive as Poses
from wildshape.drives.source import Drive
from wildshape.geometry.transforms.se3 import stack
from wildshape.records import Turn

_STEP_S, _MOST_STEPS = 0.01, 100  # rays of one place are looked at together


@dataclass(frozen=True)
class _Sweeps:
    """Reads a frame's sweep, whose points lie in the world frame."""

    files: dict[int, Path]
    poses: Poses

    def __call__(self, frame: int) -> Turn:
        number, path = list(self.files.items())[frame]
        points, times = read_sweep(path)
        stamp = self.poses.stamps[number]
        T_sensor_world = self.poses.sensor_pose(number, stamp).inverse()
        steps = np.clip(np.rint((times - stamp) / _STEP_S), -_MOST_STEPS, _MOST_STEPS)
        places = np.empty(points.shape)
        for step in np.unique(steps):
            T_world_then = self.poses.sensor_pose(number, stamp + float(step) * _STEP_S)
            places[steps == step] = T_world_then.translation.numpy()
        seen, origins = (T_sensor_world.apply_numpy(one) for one in (points, places))
        return Turn(seen.astype(np.float32), None, origins.astype(np.float32), times - stamp)


def find_pandaset(root: Path) -> list[Path]:
    """Scenes at, or one or two levels below a folder."""
    for level in ("", "*/", "*/*/"):
        scenes = sorted(path.parents[1] for path in root.glob(f"{level}{SWEEPS}/poses.json"))
        found = [scene for scene in scenes if any((scene / SWEEPS).glob(f"[!.]*{FILE}"))]
        if found:
            return found
    return []


def open_pandaset(path: Path) -> Drive:
    """One scene; a scan's time is that at which its sweep ends.

    Raises:
        BadInputError: a file is missing or corrupt.
    """
    files = frame_files(path / SWEEPS)
    drive = read_drive(path, max(files) + 1)
    stamps = [drive.stamps[frame] for frame in files]
    T = stack([drive.sensor_pose(frame, time) for frame, time in zip(files, stamps)])
    return Drive.of(
        name=path.resolve().name,
        path=path,
        scan_names=[f"{frame:02d}" for frame in files],
        read=_Sweeps(files, drive),
        times=stamps,
        T_world_sensor=T,
        files=files.values(),
    )
