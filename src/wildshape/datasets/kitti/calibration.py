# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI's text files of matrices: calibration (`name: numbers`) and odometry (a pose a line)."""

from pathlib import Path

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3

_LARGEST = 1e9  # metres or pixels; squares of far larger numbers overflow


def read_calibration(path: Path, cure: str) -> dict[str, np.ndarray]:
    """The numbers of each line by the line's name; a colon after the name is optional.

    `cure`: what brings a file that is missing, for the error.

    Raises:
        BadInputError: the file is missing or a line is not a name and numbers.
    """
    entries: dict[str, np.ndarray] = {}
    for number, line in enumerate(_lines(path, cure), start=1):
        name, *words = line.replace(":", " ").split() or [""]
        if words:
            entries[name] = _numbers(words, f"{path}, line {number}")
    return entries


def rigid(calibration: dict[str, np.ndarray], names: tuple[str, ...], path: Path) -> SE3:
    """The transform under the first of `names` that is there: 12 numbers, or 9 of a rotation.

    Raises:
        BadInputError: none is there, or it is no rigid transform; `path` is named.
    """
    found = next((name for name in names if name in calibration), None)
    if found is None:
        raise BadInputError(
            f"{path}: found {' '.join(calibration) or 'nothing'}, expected a line {names[0]}; "
            "download the calibration of this very data set."
        )
    numbers = calibration[found]
    if len(numbers) not in (9, 12):
        raise BadInputError(f"{path}: {found} has {len(numbers)} numbers, expected 12 or 9.")
    rows = numbers.reshape(3, -1)
    matrix = rows if rows.shape[1] == 4 else np.pad(rows, ((0, 0), (0, 1)))
    return _checked(matrix, f"{path}: {found}")


def read_odometry(path: Path, cure: str) -> SE3:
    """One pose a line, `(frames,)`: 12 numbers, 3x4 row-major.

    Raises:
        BadInputError: the file is missing, or a line is no pose; the line is named.
    """
    lines = [line.split() for line in _lines(path, cure) if line.strip()]
    for number, words in enumerate(lines, start=1):
        if len(words) != 12:
            raise BadInputError(
                f"{path}, line {number}: {len(words)} numbers, expected 12 (a 3x4 pose); "
                "the file is truncated or of another format, copy it again."
            )
    rows = [_numbers(words, f"{path}, line {i}") for i, words in enumerate(lines, start=1)]
    return _checked(np.asarray(rows, dtype=float).reshape(-1, 3, 4), f"{path}")


def _lines(path: Path, cure: str) -> list[str]:
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; {cure}.")
    return path.read_text(errors="replace").splitlines()


def _numbers(words: list[str], where: str) -> np.ndarray:
    try:
        numbers = np.asarray([float(word) for word in words])
    except ValueError:
        numbers = np.full(1, np.nan)
    if not (np.abs(numbers) < _LARGEST).all():
        raise BadInputError(f"{where}: expected numbers below 1e9, found '{' '.join(words)[:60]}'.")
    return numbers


def _checked(matrix: np.ndarray, where: str) -> SE3:
    try:
        return SE3.from_matrix(torch.as_tensor(matrix))
    except BadInputError as error:
        raise BadInputError(f"{where}: {error}") from None
