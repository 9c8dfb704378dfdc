# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scenes of PandaSet: the sweeps of the Pandar64, its own axes, x forward, y left, z up."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.datasets.pandaset.scene import FILE, SWEEPS, frame_files, read_drive, read_sweep
from wildshape.drives.source import Drive
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Turn


@dataclass(frozen=True)
class _Sweeps:
    """Reads a frame's sweep, whose points lie in the world frame."""

    files: tuple[Path, ...]
    T_world_sensor: SE3

    def __call__(self, frame: int) -> Turn:
        points, _ = read_sweep(self.files[frame])
        return Turn(self.T_world_sensor[frame].inverse().apply_numpy(points).astype(np.float32))


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
        scan_names=[f"{frame:02d}" for frame in files],
        read=_Sweeps(tuple(files.values()), T),
        times=stamps,
        T_world_sensor=T,
        files=files.values(),
    )
