# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The files of one log of Argoverse 2 (sensor): boxes, sweeps, poses, calibration.

Boxes and sweeps are in the egovehicle frame: x forward, y left, z up, origin on the rear axle.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, UInt8

from wildshape.datasets.argoverse2.feather import POSE, poses, read_feather
from wildshape.datasets.tracks.labelled_boxes import check_boxes
from wildshape.datasets.tracks.selection import measured
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, between
from wildshape.records import Points

Lidar = Literal["both", "up", "down"]
LABELS = "annotations.feather"
_BRINGS = "the archive of Argoverse 2's sensor split brings it, copy the log again"
_CITY = "city_SE3_egovehicle.feather"
_CALIBRATION = "calibration/egovehicle_SE3_sensor.feather"
_SIZE = ("length_m", "width_m", "height_m")
_LASERS = 32  # a LiDAR; up_lidar's come first
# Rays that begin within a step have one place: they are looked at together.
_STEP_NS, _MOST_STEPS = 10_000_000, 100


@dataclass(frozen=True)
class Boxes:
    """All labelled boxes `(b,)` of a log, in the file's order.

    Attributes:
        timestamps: of the sweep, nanoseconds.
        tracks: name of the object (`track_uuid`).
        categories: for example `REGULAR_VEHICLE`.
        sizes: full lengths along the box's own x (forward), y (left), z (up), metres.
        T_ego_object: origin at the box's centre, at the sweep's time.
    """

    timestamps: Int64[np.ndarray, " b"]
    tracks: np.ndarray
    categories: np.ndarray
    sizes: Float[np.ndarray, "b 3"]
    T_ego_object: SE3


def read_boxes(log: Path) -> Boxes:
    """The labels of a log.

    Raises:
        BadInputError: the file is missing or corrupt.
    """
    path = log / LABELS
    names = ("timestamp_ns", "track_uuid", "category")
    table = read_feather(path, (*names, *_SIZE, *POSE), _BRINGS)
    sizes = np.stack([table[name] for name in _SIZE], axis=-1)
    T_ego_object = poses(table, path)
    check_boxes(sizes, T_ego_object, str(path), _BRINGS)
    stamps, tracks, categories = (table[name] for name in names)
    return Boxes(stamps, tracks, categories, sizes, T_ego_object)


@dataclass(frozen=True)
class Sweep:
    """One turn of both LiDARs.

    The file's own type is float16: a step is 8 mm between 8 and 16 m along an axis, 16 mm up to
    32 m, 31 mm up to 64 m. Ego motion during the sweep is undone in the file.

    Attributes:
        points: `(n, 3)` in the egovehicle frame at the sweep's time, metres.
        lasers: the number of each one's laser.
        offsets_ns: when each was taken, since the sweep's time.
    """

    points: Points
    lasers: UInt8[np.ndarray, " n"]
    offsets_ns: Int64[np.ndarray, " n"]

    def part(self, rows: Bool[np.ndarray, " n"]) -> "Sweep":
        """Some of the points."""
        return Sweep(self.points[rows], self.lasers[rows], self.offsets_ns[rows])


def read_sweep(path: Path) -> Sweep:
    """A sweep's points that were measured.

    Raises:
        BadInputError: the file is corrupt.
    """
    table = read_feather(path, ("x", "y", "z", "laser_number", "offset_ns"), _BRINGS)
    points = np.stack([table[name] for name in "xyz"], axis=-1).astype(np.float32)
    offsets_ns = table["offset_ns"].astype(np.int64)
    return Sweep(points, table["laser_number"], offsets_ns).part(measured(points))


@dataclass(frozen=True)
class CityPoses:
    """Where the vehicle was, at the times of all its sensors.

    Attributes:
        stamps: nanoseconds, rising.
        T_city_ego: one pose a stamp.
    """

    stamps: Int64[np.ndarray, " t"]
    T_city_ego: SE3

    def __contains__(self, stamp: int) -> bool:
        return stamp in self.stamps

    def at(self, stamp: int) -> SE3:
        """The pose at a time, between those beside it; the first before all, the last after."""
        after = min(int(self.stamps.searchsorted(stamp)), len(self.stamps) - 1)
        before = max(after - 1, 0)
        start, end = self.stamps[[before, after]].tolist()
        share = min(max((stamp - start) / max(end - start, 1), 0.0), 1.0)
        return between(self.T_city_ego[before], self.T_city_ego[after], share)

    def ray_starts(
        self, stamp: int, sweep: Sweep, T_ego_lidars: tuple[SE3, SE3]
    ) -> Float[np.ndarray, "n 3"]:
        """Where the ray of each point began, in the egovehicle frame at the sweep's time, metres.

        The LiDARs, up_lidar and then down_lidar, go on with the vehicle while they turn.
        """
        T_stamp_city = self.at(stamp).inverse()
        steps = np.clip(np.rint(sweep.offsets_ns / _STEP_NS), -_MOST_STEPS, _MOST_STEPS)
        starts = np.empty_like(sweep.points)
        for step in np.unique(steps):
            T_stamp_ego = T_stamp_city @ self.at(stamp + int(step) * _STEP_NS)
            up, down = ((T_stamp_ego @ T).translation.numpy() for T in T_ego_lidars)
            rows = steps == step
            starts[rows] = np.where(taken_by("up", sweep.lasers[rows])[:, None], up, down)
        return starts


def read_city_poses(log: Path) -> CityPoses:
    """The poses of a log.

    Raises:
        BadInputError: the file is missing or corrupt.
    """
    table = read_feather(log / _CITY, ("timestamp_ns", *POSE), _BRINGS)
    stamps, first = np.unique(table["timestamp_ns"].astype(np.int64), return_index=True)
    return CityPoses(stamps, poses(table, log / _CITY)[torch.from_numpy(first)])


def read_sensor_pose(log: Path, lidar: Lidar) -> SE3:
    """`T_ego_sensor` of the scans.

    The two LiDARs stand on one pole, 12 cm apart, `down_lidar` upside down. Whichever is taken,
    the axes are `up_lidar`'s (x forward, y left, z up); of both, the origin is halfway.

    Raises:
        BadInputError: the file is missing, corrupt or lacks a LiDAR.
    """
    return sensor_pose_in(log / _CALIBRATION, lidar, _BRINGS)


def sensor_pose_in(path: Path, lidar: Lidar, brings: str) -> SE3:
    """The same from the file itself; `brings`: what to get where it is missing, in words.

    Raises:
        BadInputError: as `read_sensor_pose`.
    """
    table = read_feather(path, ("sensor_name", *POSE), brings)
    T_ego_any = poses(table, path)
    rows = {name: i for i, name in enumerate(table["sensor_name"])}
    absent = {"up_lidar", "down_lidar"} - set(rows)
    if absent:
        raise BadInputError(f"{path}: no sensor {min(absent)} in it; {brings}.")
    up, down = (T_ego_any[rows[name]] for name in ("up_lidar", "down_lidar"))
    share = {"up": 0.0, "both": 0.5, "down": 1.0}[lidar]
    return SE3(up.rotation, (1 - share) * up.translation + share * down.translation)


def taken_by(lidar: Lidar, lasers: UInt8[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Which points a LiDAR took, by the numbers of their lasers."""
    if lidar == "both":
        return np.ones(len(lasers), bool)
    return (lasers < _LASERS) == (lidar == "up")
