# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tables in Arrow's feather files, as columns of numpy."""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.errors import BadInputError, MissingExtraError
from wildshape.geometry.rotation import rotation_from_quaternion
from wildshape.geometry.se3 import SE3
from wildshape.io.guard import reading

Columns = dict[str, np.ndarray]
_QUATERNION, _TRANSLATION = ("qw", "qx", "qy", "qz"), ("tx_m", "ty_m", "tz_m")
POSE = _QUATERNION + _TRANSLATION


def read_feather(path: Path, names: tuple[str, ...], brings: str) -> Columns:
    """The named columns of a table, all `(n,)`; text comes as an array of objects.

    Args:
        path: of the file.
        names: of the columns.
        brings: what to get where the file is missing, in words.

    Raises:
        BadInputError: the file is missing, damaged or lacks a column.
        MissingExtraError: pyarrow is not installed.
    """
    feather = _pyarrow_feather()
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; {brings}.")
    with reading(path, "a feather table"):
        # No memory map: a file cut off under it would end the program.
        table = feather.read_table(path, memory_map=False)
        absent = [name for name in names if name not in table.column_names]
        if absent:
            raise BadInputError(
                f"{path}: no column {absent[0]} among {', '.join(table.column_names)}; {brings}."
            )
        return {name: table[name].to_numpy() for name in names}


def poses(columns: Columns, path: Path) -> SE3:
    """One pose a row from the columns named in `POSE`, metres.

    Raises:
        BadInputError: a row holds no finite numbers or no unit quaternion.
    """
    quaternion, translation = (
        torch.as_tensor(np.stack([columns[name] for name in names], axis=-1), dtype=torch.float64)
        for names in (_QUATERNION, _TRANSLATION)
    )
    good = (quaternion.norm(dim=-1) - 1).abs() < 1e-3
    good &= translation.isfinite().all(dim=-1)
    if not bool(good.all()):
        row = int((~good).nonzero()[0])
        raise BadInputError(f"{path}: row {row} holds no pose; download the file again.")
    return SE3(rotation_from_quaternion(quaternion), translation)


def _pyarrow_feather() -> Any:
    try:
        from pyarrow import feather
    except ImportError as error:
        raise MissingExtraError(
            "feather files are read by pyarrow, which is not installed: "
            "pip install 'wildshape[arrow]'."
        ) from error
    return feather
