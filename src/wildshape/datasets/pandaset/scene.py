# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The files of one scene of PandaSet: cuboids, sweeps and where the Pandar64 was.

Points and cuboids are in the scene's world frame. `lidar/poses.json` holds, despite its name, the
poses of the vehicle's base: x right, y forward, z up, origin on the ground under the rear axle, at
the END of each sweep. Measured by the beams of the Pandar64: about that origin none of them stands
where its data sheet has it, about the mounting below they do.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from wildshape.datasets.pandaset.pandas_pickle import read_pickled_table
from wildshape.datasets.tracks.labelled_boxes import WORLD_M, check_boxes
from wildshape.datasets.tracks.parts import numbered
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_from_quaternion, rotation_z
from wildshape.geometry.transforms.se3 import SE3, between
from wildshape.io.guard import read_json, reading
from wildshape.records import Points

CUBOIDS, SWEEPS, FILE = "annotations/cuboids", "lidar", ".pkl.gz"
PANDAR64 = 0
PANDARGT = 1
_POSES, _STAMPS = "lidar/poses.json", "lidar/timestamps.json"
_BRINGS = "get the scene's archive from PandaSet again"
_SIZE = ("dimensions.y", "dimensions.x", "dimensions.z")  # its x is the width, left to right
_CENTRE = ("position.x", "position.y", "position.z")


def _mounting() -> SE3:
    """`T_base_sensor` of the Pandar64, one for all scenes; its own axes, x forward, y left, z up.

    The mean over a standing scene (002) of the front camera's poses and the published calibration
    between camera and LiDAR, whose own axes are x left, y back; they agree to 2 mm and 0.01 degree.
    """
    wxyz = (0.0158841, 0.0001209, 0.0078418, -0.9998431)
    T_base_lidar = SE3(
        rotation_from_quaternion(torch.tensor(wxyz, dtype=torch.float64)),
        torch.tensor((0.0002, 0.8078, 1.8460), dtype=torch.float64),
    )
    quarter = rotation_z(torch.tensor(-torch.pi / 2, dtype=torch.float64))
    return T_base_lidar @ SE3(quarter, torch.zeros(3, dtype=torch.float64))


@dataclass(frozen=True)
class Cuboids:
    """The labelled boxes `(b,)` of one frame.

    Attributes:
        tracks: name of the object (`uuid`).
        categories: for example `Pickup Truck`.
        sensors: whose points the box was drawn around: `PANDAR64` or `PANDARGT`; -1: any's.
        sizes: full lengths along the box's own x (forward), y (left), z (up), metres.
        T_world_object: origin at the box's centre.
    """

    tracks: np.ndarray
    categories: np.ndarray
    sensors: np.ndarray
    sizes: Float[np.ndarray, "b 3"]
    T_world_object: SE3


def frame_files(folder: Path) -> dict[int, Path]:
    """The files of a folder by the number of their frame, in order; others are passed over.

    Raises:
        BadInputError: there is none.
    """
    return numbered(folder, FILE, f"holds none of 00{FILE} to 79{FILE}; {_BRINGS}")


def read_cuboids(path: Path) -> Cuboids:
    """The labels of a frame.

    Raises:
        BadInputError: the file is missing, corrupt or lacks a column.
    """
    names = ("uuid", "label", "cuboids.sensor_id", "yaw", *_SIZE, *_CENTRE)
    table = _table(path, names)
    with reading(path, "PandaSet's cuboids"):
        sizes, centres = (_numbers(table, group) for group in (_SIZE, _CENTRE))
        # PandaSet's cuboids face along their own y.
        yaw = torch.as_tensor(_numbers(table, ("yaw",))[:, 0] + np.pi / 2)
        poses = SE3(rotation_z(yaw), torch.as_tensor(centres))
        check_boxes(sizes, poses, str(path), _BRINGS)
        tracks, categories = (np.array([*map(str, table[name])], object) for name in names[:2])
        return Cuboids(tracks, categories, table["cuboids.sensor_id"], sizes, poses)


def read_sweep(path: Path) -> tuple[Points, Float[np.ndarray, " n"]]:
    """What the Pandar64 saw, `(n, 3)` world frame, metres, and when, seconds.

    Raises:
        BadInputError: the file is missing, corrupt or lacks a column.
    """
    table = _table(path, ("x", "y", "z", "t", "d"))
    with reading(path, "a sweep of PandaSet"):
        points = _numbers(table, ("x", "y", "z"))
        times = _numbers(table, ("t",))[:, 0]
        kept = (table["d"] == PANDAR64) & np.isfinite(points).all(axis=1) & np.isfinite(times)
        return points[kept], times[kept]


def _numbers(table: dict[str, np.ndarray], names: tuple[str, ...]) -> Float[np.ndarray, "n c"]:
    return np.stack([table[name] for name in names], axis=-1).astype(np.float64, copy=False)


def _table(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    table = read_pickled_table(path)
    absent = [name for name in names if name not in table]
    if absent:
        raise BadInputError(f"{path}: no column {absent[0]} among {', '.join(table)}; {_BRINGS}.")
    return table


@dataclass(frozen=True)
class Drive:
    """Where the vehicle was: `T_world_base` at the ends of the sweeps `(f,)`, times in seconds."""

    stamps: list[float]
    T_world_base: SE3

    def sensor_pose(self, frame: int, time: float) -> SE3:
        """`T_world_sensor` of the Pandar64 at a time during the sweep of a frame.

        Between the poses at the sweep's ends; the first sweep's start is carried back from the
        second's motion. A scene of a single frame is taken to stand.
        """
        last = max(frame, 1)
        if last >= len(self.stamps):
            return self.T_world_base[frame] @ _mounting()
        start, end = self.stamps[last - 1], self.stamps[last]
        T = between(
            self.T_world_base[last - 1], self.T_world_base[last], (time - start) / (end - start)
        )
        return T @ _mounting()


def read_drive(scene: Path, frames: int) -> Drive:
    """The poses of a scene, which has at least so many frames.

    Raises:
        BadInputError: a file is missing or corrupt, or has another number of poses.
    """
    poses, stamps = (read_json(scene / file, "a JSON list", list) for file in (_POSES, _STAMPS))
    if len(poses) != len(stamps) or len(poses) < frames:
        raise BadInputError(
            f"{scene}: {len(poses)} poses and {len(stamps)} timestamps in lidar/ for {frames} "
            f"labelled frames; {_BRINGS}."
        )
    with reading(scene / _POSES, "poses and timestamps of PandaSet's LiDAR"):
        place = [[float(pose["position"][axis]) for axis in "xyz"] for pose in poses]
        heading = [[float(pose["heading"][axis]) for axis in "wxyz"] for pose in poses]
        quaternion = torch.tensor(heading, dtype=torch.float64)
        if not bool(((quaternion.norm(dim=-1) - 1).abs() <= 1e-3).all()):
            raise BadInputError(f"{scene / _POSES}: a heading is no unit quaternion; {_BRINGS}.")
        T = SE3(rotation_from_quaternion(quaternion), torch.tensor(place, dtype=torch.float64))
        times = [float(stamp) for stamp in stamps]
    if not bool((T.translation.abs() <= WORLD_M).all()):  # NaN is none either
        raise BadInputError(f"{scene / _POSES}: a position is no place on a map; {_BRINGS}.")
    rise = all(earlier < later for earlier, later in pairwise(times))
    if not rise or not all(map(math.isfinite, times)):
        raise BadInputError(f"{scene / _STAMPS}: the times do not rise; {_BRINGS}.")
    return Drive(times, T)
