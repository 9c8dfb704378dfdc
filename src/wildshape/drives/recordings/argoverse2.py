# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Logs of Argoverse 2's sensor data set: the sweeps of both LiDARs, in `up_lidar`'s axes."""

from dataclasses import dataclass
from pathlib import Path

from wildshape.datasets.argoverse2.log import (
    CityPoses,
    read_city_poses,
    read_sensor_pose,
    read_sweep,
)
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Turn

_SWEEPS = "sensors/lidar"
_POSES = "city_SE3_egovehicle.feather"


@dataclass(frozen=True)
class _Sweeps:
    """Reads a frame's sweep: the data set has undone the motion during it."""

    files: tuple[Path, ...]
    T_sensor_ego: SE3
    T_ego_lidars: tuple[SE3, SE3]
    city: CityPoses | None

    def __call__(self, frame: int) -> Turn:
        sweep = read_sweep(self.files[frame])
        points = self.T_sensor_ego.apply_numpy(sweep.points)
        met = sweep.offsets_ns / 1e9
        if self.city is None:
            return Turn(points, met=met)
        starts = self.city.ray_starts(int(self.files[frame].stem), sweep, self.T_ego_lidars)
        return Turn(points, origins=self.T_sensor_ego.apply_numpy(starts), met=met)


def find_logs(root: Path) -> list[Path]:
    """Logs at, or one to three levels below a folder."""
    for level in ("", "*/", "*/*/", "*/*/*/"):
        logs = sorted(path.parent for path in root.glob(f"{level}{_POSES}"))
        found = [log for log in logs if (log / _SWEEPS).is_dir()]
        if found:
            return found
    return []


def open_log(path: Path) -> Drive:
    """One log.

    Raises:
        BadInputError: a file is missing or corrupt.
        MissingExtraError: pyarrow is not installed.
    """
    found = (path / _SWEEPS).glob("*.feather")
    files = sorted((file for file in found if file.stem.isdecimal()), key=lambda f: int(f.stem))
    if not files:
        raise BadInputError(f"{path / _SWEEPS}: holds no sweeps; copy the log again.")
    stamps = [int(file.stem) for file in files]
    T_ego_sensor = read_sensor_pose(path, "both")
    city = read_city_poses(path)
    lacking = sum(stamp not in city for stamp in stamps)
    told = f"{_POSES} lacks {lacking} of {len(stamps)} sweeps; none of its poses are taken"
    return Drive.of(
        name=path.resolve().name,
        path=path,
        scan_names=[file.stem for file in files],
        read=_Sweeps(
            tuple(files),
            T_ego_sensor.inverse(),
            (read_sensor_pose(path, "up"), read_sensor_pose(path, "down")),
            None if lacking else city,
        ),
        times=[stamp / 1e9 for stamp in stamps],
        T_world_sensor=None if lacking else stack([city.at(t) for t in stamps]) @ T_ego_sensor,
        warnings=(told,) if lacking else (),
        files=files,
    )
