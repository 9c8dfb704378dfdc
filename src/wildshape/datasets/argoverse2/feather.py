# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tables in Arrow's feather files, as columns of numpy."""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.datasets.argoverse2.unpacked import unpacked_bytes
from wildshape.datasets.tracks.labelled_boxes import WORLD_M
from wildshape.errors import BadInputError, load_library
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import check_unpacked, reading

Columns = dict[str, np.ndarray]
_QUATERNION, _TRANSLATION = ("qw", "qx", "qy", "qz"), ("tx_m", "ty_m", "tz_m")
POSE = _QUATERNION + _TRANSLATION
_WHOLE = ("timestamp_ns", "laser_number", "offset_ns")
_MAGIC_BYTES = 8
_TEXTS = ("track_uuid", "category", "sensor_name")


def read_feather(path: Path, names: tuple[str, ...], brings: str) -> Columns:
    """The named columns of a table, all `(n,)`; text comes as an array of objects.

    `brings`: what to get where the file is missing, in words.

    Raises:
        BadInputError: the file is missing, damaged or lacks a column.
        MissingExtraError: pyarrow is not installed.
    """
    load_library("pyarrow", "feather files need pyarrow", "pip install 'wildshape[arrow]'")
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; {brings}.")
    with reading(path, "a feather table"):
        # No memory map: a file cut off under it would end the program.
        data = path.read_bytes()
        found = _column_names(data)
        absent = [name for name in names if name not in found]
        if absent:
            raise BadInputError(
                f"{path}: no column {absent[0]} among {', '.join(found)}; {brings}."
            )
        check_unpacked(path, unpacked_bytes(_stream(data)), len(data))
        table = _table(data, [found.index(name) for name in names])
        table.validate(full=True)  # damaged texts would be read outside of the file
        for name in names:
            _check_column(table[name], name, path, brings)
        return {name: table[name].to_numpy() for name in names}


def _column_names(data: bytes) -> list[str]:
    """What the table has, before a column is unpacked."""
    import pyarrow
    from pyarrow import ipc

    with ipc.open_file(pyarrow.BufferReader(data)) as table:
        return table.schema.names


def _stream(data: bytes) -> Any:
    """What lies between the magic and the footer, which could list a batch many times."""
    import pyarrow

    stream = pyarrow.BufferReader(data)
    stream.seek(_MAGIC_BYTES)
    return stream


def _table(data: bytes, columns: list[int]) -> Any:
    from pyarrow import ipc

    wanted = ipc.IpcReadOptions(included_fields=sorted(columns))
    with ipc.open_stream(_stream(data), options=wanted) as stream:
        return stream.read_all()


def _check_column(column: Any, name: str, path: Path, brings: str) -> None:
    """Numbers, or text where the name says so, in every row."""
    from pyarrow import types

    kind = column.type
    text = types.is_string(kind) or types.is_large_string(kind) or types.is_dictionary(kind)
    number = types.is_integer(kind) or (types.is_floating(kind) and name not in _WHOLE)
    fits = text if name in _TEXTS else number
    if not fits or column.null_count:
        found = f"{kind}, {column.null_count} rows of which are empty"
        raise BadInputError(f"{path}: the column {name} is of {found}; {brings}.")


def poses(columns: Columns, path: Path) -> SE3:
    """One pose a row from the columns named in `POSE`, metres.

    Raises:
        BadInputError: a row holds no place on a map or no unit quaternion.
    """
    quaternion, translation = (
        torch.as_tensor(np.stack([columns[name] for name in names], axis=-1), dtype=torch.float64)
        for names in (_QUATERNION, _TRANSLATION)
    )
    good = (quaternion.norm(dim=-1) - 1).abs() < 1e-3
    good &= (translation.abs() <= WORLD_M).all(dim=-1)  # NaN is none either
    if not bool(good.all()):
        row = int((~good).nonzero()[0])
        raise BadInputError(f"{path}: row {row} holds no pose; download the file again.")
    return SE3(rotation_from_quaternion(quaternion), translation)
