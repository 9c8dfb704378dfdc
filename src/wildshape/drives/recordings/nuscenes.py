# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scenes of nuScenes: the sweeps of LIDAR_TOP, 20 a second, x right, y forward, z up."""

from dataclasses import dataclass
from pathlib import Path

from wildshape.datasets.nuscenes.json_rows import json_rows
from wildshape.datasets.nuscenes.reader import file_of, find_tables, info_of, read_sweep
from wildshape.datasets.nuscenes.scene import read_scene
from wildshape.datasets.nuscenes.table_index import cache_folder, index_of, lidar_of
from wildshape.drives.recordings.beam_order import met_in_order
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import stack
from wildshape.io.scans.turns import read_turn
from wildshape.records import Turn

_TURN_S = 0.05  # of LIDAR_TOP


@dataclass(frozen=True)
class _Sweeps:
    """Reads a frame's sweep.

    nuScenes has corrected it for the motion of the vehicle. TruckScenes has not: its points have
    times.
    """

    files: tuple[Path, ...]
    infos: tuple[Path | None, ...]
    times: tuple[float, ...]

    def __call__(self, frame: int) -> Turn:
        file = self.files[frame]
        if file.suffix == ".pcd":
            return read_turn(file, self.times[frame])
        points = read_sweep(file, self.infos[frame])
        return Turn(points, met=met_in_order(points, _TURN_S))


def find_scenes(root: Path) -> list[Path]:
    """The scenes of a release, as paths below its folder.

    Raises:
        BadInputError: its table is corrupt or names none.
    """
    if not (root / "scene.json").is_file() and not any(root.glob("*/scene.json")):
        return []
    tables = find_tables(root)
    names = {str(row["name"]) for row in json_rows(tables / "scene.json") if "name" in row}
    if not names:
        path = tables / "scene.json"
        raise BadInputError(f"{path}: names no scene; unpack nuScenes' metadata archive again.")
    return [root / name for name in sorted(names)]


def open_scene(path: Path) -> Drive:
    """One scene, by its name below the release's folder.

    Raises:
        BadInputError: a table is missing or corrupt, or none of the scene's sweeps is there.
    """
    tables = find_tables(path.parent)
    channel = lidar_of(tables, "")
    with index_of(tables, cache_folder(), channel) as db:
        scene = read_scene(db, path.name, sweeps=True)
    there = [(frame, file_of(tables, frame)) for frame in scene.frames]
    there = [(frame, file) for frame, file in there if file.is_file()]
    if not there:
        raise BadInputError(f"{path}: none of its {channel} files is here; unpack their blobs.")
    infos = tuple(info_of(tables, frame) for frame, _ in there)
    times = tuple(frame.microseconds / 1e6 for frame, _ in there)
    return Drive.of(
        name=path.name,
        path=path,
        scan_names=[frame.name for frame, _ in there],
        read=_Sweeps(tuple(file for _, file in there), infos, times),
        times=times,
        T_world_sensor=stack([frame.T_global_sensor for frame, _ in there]),
        files=[file for _, file in there],
    )
