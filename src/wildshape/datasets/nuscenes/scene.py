# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One scene of nuScenes: where LIDAR_TOP was, and where the labelled boxes were."""

import sqlite3
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.geometry.transforms.se3 import SE3, between

_LEAST_UP, _FEW_LEANING = 0.866, 0.1  # cosine of 30 degrees; a share


@dataclass(frozen=True)
class Frame:
    """One sweep of LIDAR_TOP.

    Attributes:
        file: relative to the data root.
        sample: number of the key frame that it is, or that follows it.
        is_key: whether its boxes were labelled.
        microseconds: Unix time.
        info: file that may say how many numbers a point has (T4), relative to the data root.
    """

    file: str
    sample: int
    is_key: bool
    microseconds: int
    T_global_sensor: SE3
    info: str

    @property
    def name(self) -> str:
        """The file's own, without folder and suffix."""
        return PurePosixPath(self.file).name.removesuffix(".bin").removesuffix(".pcd")


@dataclass(frozen=True)
class Labelled:
    """One object's box at one time.

    Attributes:
        size: full lengths along its own x, y, z (length, width, height), metres.
        T_global_object: one pose, origin at the box's centre, x forward, y left, z up.
    """

    size: tuple[float, float, float]
    T_global_object: SE3


@dataclass(frozen=True)
class Scene:
    """Frames in time order; boxes of each key frame by object; objects' categories by token."""

    name: str
    frames: tuple[Frame, ...]
    boxes: dict[int, dict[str, Labelled]]
    categories: dict[str, str]

    def boxes_at(self, frame: Frame) -> dict[str, Labelled]:
        """Labelled boxes of a key frame; between two key frames those of objects seen in both.

        Boxes there are interpolated; before the first and after the last key frame there are none.
        """
        if frame.is_key:
            return self.boxes.get(frame.sample, {})
        keys = [f for f in self.frames if f.is_key]
        after = bisect_right([f.microseconds for f in keys], frame.microseconds)
        if not 0 < after < len(keys):
            return {}
        start, end = keys[after - 1], keys[after]
        share = (frame.microseconds - start.microseconds) / (end.microseconds - start.microseconds)
        first, second = self.boxes.get(start.sample, {}), self.boxes.get(end.sample, {})
        return {t: _between(first[t], second[t], share) for t in first if t in second}


def read_scene(db: sqlite3.Connection, name: str, *, sweeps: bool) -> Scene:
    """A scene out of `table_index.index_of`; `sweeps`: the frames between the key frames, too.

    Raises:
        BadInputError: there is no such scene.
    """
    found = db.execute("SELECT id FROM scene WHERE name = ?", (name,)).fetchone()
    if found is None:
        raise BadInputError(f"{name}: no scene of this name in scene.json; check it.")
    frames = _read_frames(db, found[0], sweeps=sweeps)
    boxes, categories = _read_boxes(db, found[0])
    return Scene(name, frames, boxes, categories)


def _read_frames(db: sqlite3.Connection, scene: int, *, sweeps: bool) -> tuple[Frame, ...]:
    rows = db.execute(
        "SELECT file, info, sample, is_key, timestamp, e.x, e.y, e.z, e.qw, e.qx, e.qy, e.qz,"
        " c.x, c.y, c.z, c.qw, c.qx, c.qy, c.qz FROM frame"
        " JOIN ego e ON e.id = ego JOIN calibration c ON c.id = calibration"
        " WHERE scene = ? AND is_key >= ? ORDER BY timestamp",
        (scene, 0 if sweeps else 1),
    ).fetchall()
    if not rows:
        return ()
    T_global_ego = _poses([row[5:12] for row in rows])
    _check_level(T_global_ego, "ego_pose.json")
    T_global_sensor = T_global_ego @ _poses([row[12:] for row in rows])
    return tuple(
        Frame(file, sample, bool(is_key), time, T_global_sensor[i], info or "")
        for i, (file, info, sample, is_key, time, *_) in enumerate(rows)
    )


def _read_boxes(
    db: sqlite3.Connection, scene: int
) -> tuple[dict[int, dict[str, Labelled]], dict[str, str]]:
    rows = db.execute(
        "SELECT sample, token, category, width, length, height, x, y, z, qw, qx, qy, qz FROM box"
        " JOIN instance ON instance.id = instance WHERE scene = ? ORDER BY box.rowid",
        (scene,),
    ).fetchall()
    boxes: dict[int, dict[str, Labelled]] = {}
    poses = _poses([row[6:] for row in rows]) if rows else None
    if poses is not None:
        _check_level(poses, "sample_annotation.json")
    for i, (sample, token, _, width, length, height, *_) in enumerate(rows):
        if poses is not None:
            boxes.setdefault(sample, {})[token] = Labelled((length, width, height), poses[i])
    return boxes, {row[1]: row[2] for row in rows}


def _poses(rows: list[tuple[float, ...]]) -> SE3:
    """One pose a row of x y z qw qx qy qz."""
    numbers = torch.as_tensor(np.asarray(rows, np.float64))
    return SE3(rotation_from_quaternion(numbers[:, 3:]), numbers[:, :3])


def _check_level(poses: SE3, table: str) -> None:
    """Refuse vehicles that lean as none does: numbers in another order are quaternions, too."""
    leaning = int((poses.rotation[:, 2, 2] < _LEAST_UP).sum())
    if leaning > _FEW_LEANING * len(poses):
        raise BadInputError(
            f"{table}: {leaning} of {len(poses)} rotations of a scene lean by more than 30 degrees;"
            " write them as w x y z, in a frame whose z looks up."
        )


def _between(start: Labelled, end: Labelled, share: float) -> Labelled:
    return Labelled(start.size, between(start.T_global_object, end.T_global_object, share))
