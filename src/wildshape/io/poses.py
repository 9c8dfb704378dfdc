# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses as text, metres: `poses.txt`, TUM's trajectories, and JSON with their smoothness.

`poses.txt` and KITTI have 12 numbers a line, the 3x4 of `T`, row-major; TUM has
`time x y z qx qy qz qw`.
"""

from bisect import bisect
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from wildshape.geometry.transforms.se3 import SE3, several
from wildshape.geometry.transforms.smoothness import smoothness
from wildshape.io.atomic import write_json, write_text
from wildshape.io.guard import reading

_ORTHONORMAL = 1e-3
_FARTHEST = 1e12  # a map may be in millimetres; squares of far larger numbers overflow
_WHAT = "T_sensor_canonical of each scan: the object as the sensor of that scan sees it, metres"


def read_poses(path: Path | str, expected: int | None = None) -> SE3:
    """One transform a line, float64.

    Args:
        path: the file.
        expected: how many lines there must be, for example the number of scans.

    Raises:
        BadInputError: another number of lines, a line without 12 finite numbers, or a line whose
            3x3 block is no rotation; the line and its determinant are named.
    """
    path = as_path(path, "path")
    with reading(path, "12 numbers a line"):
        lines = path.read_text("utf-8-sig").splitlines()
        rows = [_parse(line, i, path) for i, line in enumerate(lines, 1) if line.strip()]
    if expected is not None and len(rows) != expected:
        raise BadInputError(
            f"{path}: {len(rows)} lines of poses for {expected} scans (the last is line "
            f"{len(rows)}); write one line a scan, in the order of the scans' names."
        )
    return SE3.from_matrix(np.array(rows, np.float64).reshape(-1, 3, 4))


def _parse(line: str, number: int, path: Path) -> np.ndarray:
    try:
        values = np.array([float(word) for word in line.replace(",", " ").split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != 12 or not (np.abs(values) < _FARTHEST).all():
        raise BadInputError(
            f"{path}, line {number}: expected 12 finite numbers (3x4 row-major), found "
            f"'{line.strip()[:60]}'; write one pose a line."
        )
    pose = values.reshape(3, 4)
    rotation = pose[:, :3]
    with np.errstate(all="ignore"):
        determinant = float(np.linalg.det(rotation))
        error = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not (error <= _ORTHONORMAL and determinant > 0):
        raise BadInputError(
            f"{path}, line {number}: the 3x3 block is no rotation (determinant {determinant:.4f}, "
            "should be 1 with perpendicular rows); remove scale, shear and mirroring."
        )
    return pose


def write_poses(path: Path | str, poses: SE3 | np.ndarray | Sequence[SE3]) -> None:
    """Write `(n,)` transforms, 12 numbers a line at full precision, atomically.

    Raises:
        BadInputError: see `several`; a pose is not finite.
    """
    rows = _finite(poses, path).matrix[..., :3, :].detach().cpu().numpy().reshape(-1, 12)
    write_text(path, "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows))


def _finite(poses: object, path: Path | str) -> SE3:
    found = several(poses, "poses")
    if not bool(found.translation.isfinite().all() and found.rotation.isfinite().all()):
        raise BadInputError(f"{path}: poses that are NaN or infinite are not written; drop these.")
    return found


def places_of(scan_names: Sequence[str], skipped: Sequence[str] = ()) -> list[int]:
    """Each scan's place in its track, from 0, those counted that were skipped.

    Args:
        scan_names: those that are left, in the order of their files' names; scans in another order
            are counted alone.
        skipped: names of the other scans' files.
    """
    files = [f"{name}." for name in scan_names]  # a suffix follows: a-1.ply is before a.ply
    others = sorted(skipped) if files == sorted(files) else []
    return [place + bisect(others, file) for place, file in enumerate(files)]


def times_of(scan_names: Sequence[str], skipped: Sequence[str] = ()) -> list[int]:
    """What the scans' names count, if all do and rise; else their places (`places_of`)."""
    if all(name.isascii() and name.isdigit() for name in scan_names):
        times = [int(name) for name in scan_names]
        if all(a < b for a, b in pairwise(times)):
            return times
    return places_of(scan_names, skipped)


def write_tum(path: Path | str, poses: SE3, times: Sequence[float] | Sequence[int]) -> None:
    """Write `(n,)` poses, a line each, at full precision, atomically.

    Raises:
        BadInputError: see `write_poses`; another number of times.
    """
    poses = _finite(poses, path)
    if len(times) != len(poses):
        raise BadInputError(f"{path}: {len(times)} times for {len(poses)} poses; pass one each.")
    wxyz = quaternion_from_rotation(poses.rotation.double())
    rows = torch.cat((poses.translation.double(), wxyz[:, 1:], wxyz[:, :1]), dim=-1).tolist()
    lines = [f"{time} {' '.join(map(repr, row))}\n" for time, row in zip(times, rows, strict=True)]
    write_text(path, "".join(lines))


def read_tum(path: Path | str) -> tuple[list[float], SE3]:
    """Times and poses.

    Raises:
        BadInputError: a line is not of 8 finite numbers with a unit quaternion.
    """
    path = as_path(path, "path")
    with reading(path, "8 numbers a line: time x y z qx qy qz qw"):
        lines = path.read_text("utf-8-sig").splitlines()
        rows = np.array([line.split() for line in lines if line[:1] not in ("", "#")], np.float64)
    numbers = torch.from_numpy(rows)
    good = rows.ndim == 2 and rows.shape[1] == 8 and bool(numbers.isfinite().all())
    if not good or bool(((numbers[:, 4:].norm(dim=-1) - 1).abs() > 1e-3).any()):
        raise BadInputError(f"{path}: expected lines of time x y z qx qy qz qw; write them so.")
    wxyz = numbers[:, [7, 4, 5, 6]]
    return numbers[:, 0].tolist(), SE3(rotation_from_quaternion(wxyz), numbers[:, 1:4])


def write_trajectory(
    path: Path, poses: SE3, scan_names: Sequence[str], skipped: Sequence[str] = ()
) -> None:
    """Write poses by scan with the figures of `Smoothness` (null for fewer than three scans).

    `skipped`: names of the files of scans that have no pose.
    """
    found = smoothness(poses)
    rows = [
        {"scan": name, "time": time, "T_sensor_canonical": matrix}
        for name, time, matrix in zip(
            scan_names, times_of(scan_names, skipped), poses.matrix.tolist(), strict=True
        )
    ]
    figures = None if found is None else asdict(found)
    write_json(path, {"format": 1, "what": _WHAT, "smoothness": figures, "poses": rows})
