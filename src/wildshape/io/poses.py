# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Poses as text: 12 numbers a line, the 3x4 of `T`, row-major, metres."""

from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import write_text
from wildshape.io.guard import reading

_ORTHONORMAL = 1e-3
_FARTHEST_M = 1e9  # no drive goes farther, and squares of far larger numbers overflow


def read_poses(path: Path | str, expected: int | None = None) -> SE3:
    """One transform a line, float64.

    Args:
        path: the file.
        expected: how many lines there must be, for example the number of scans.

    Raises:
        BadInputError: another number of lines, a line without 12 finite numbers, or a line whose
            3x3 block is no rotation; the line and its determinant are named.
    """
    path = Path(path)
    with reading(path, "12 numbers a line"):
        lines = path.read_text("utf-8").splitlines()
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
    if len(values) != 12 or not (np.abs(values) < _FARTHEST_M).all():
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


def write_poses(path: Path | str, poses: SE3) -> None:
    """Write `(n,)` transforms, 12 numbers a line at full precision, atomically."""
    rows = poses.matrix[..., :3, :].detach().cpu().numpy().reshape(-1, 12)
    write_text(path, "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows))
