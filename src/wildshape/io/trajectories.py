# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Trajectories as TUM's text (`time x y z qx qy qz qw`) and as JSON with their smoothness.

KITTI's pose format, 12 numbers a line, is that of `poses.txt`.
"""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.smoothness import smoothness
from wildshape.io.atomic import write_json, write_text
from wildshape.io.guard import reading

_WHAT = "T_sensor_canonical of each scan: the object as the sensor of that scan sees it, metres"


def times_of(scan_names: Sequence[str]) -> list[int]:
    """What the scans' names count, if all do and rise; else 0, 1, 2, ..."""
    if all(name.isascii() and name.isdigit() for name in scan_names):
        times = [int(name) for name in scan_names]
        if all(a < b for a, b in pairwise(times)):
            return times
    return list(range(len(scan_names)))


def write_tum(path: Path, poses: SE3, times: Sequence[int]) -> None:
    """Write `(n,)` poses, a line each, at full precision, atomically."""
    wxyz = quaternion_from_rotation(poses.rotation.double())
    rows = torch.cat((poses.translation.double(), wxyz[:, 1:], wxyz[:, :1]), dim=-1).tolist()
    lines = [f"{time} {' '.join(map(repr, row))}\n" for time, row in zip(times, rows, strict=True)]
    write_text(path, "".join(lines))


def read_tum(path: Path) -> tuple[list[float], SE3]:
    """Times and poses.

    Raises:
        BadInputError: a line is not of 8 finite numbers with a unit quaternion.
    """
    with reading(path, "8 numbers a line: time x y z qx qy qz qw"):
        lines = path.read_text("utf-8").splitlines()
        rows = np.array([line.split() for line in lines if line[:1] not in ("", "#")], np.float64)
    numbers = torch.from_numpy(rows)
    good = rows.ndim == 2 and rows.shape[1] == 8 and bool(numbers.isfinite().all())
    if not good or bool(((numbers[:, 4:].norm(dim=-1) - 1).abs() > 1e-3).any()):
        raise BadInputError(f"{path}: expected lines of time x y z qx qy qz qw; write them so.")
    wxyz = numbers[:, [7, 4, 5, 6]]
    return numbers[:, 0].tolist(), SE3(rotation_from_quaternion(wxyz), numbers[:, 1:4])


def write_trajectory(path: Path, poses: SE3, scan_names: Sequence[str]) -> None:
    """Write poses by scan with the figures of `Smoothness` (null for fewer than three scans)."""
    found = smoothness(poses)
    rows = [
        {"scan": name, "time": time, "T_sensor_canonical": matrix}
        for name, time, matrix in zip(
            scan_names, times_of(scan_names), poses.matrix.tolist(), strict=True
        )
    ]
    figures = None if found is None else asdict(found)
    write_json(path, {"format": 1, "what": _WHAT, "smoothness": figures, "poses": rows})
