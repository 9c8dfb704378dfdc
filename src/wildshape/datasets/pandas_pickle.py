# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tables that pandas has pickled, read without pandas and without running what a pickle says.

A pickle is a program: it names things to import and to call. Here every name that it may say
(`_NAMES`) stands for a stand-in of ours that only keeps what it is given, numpy's own included: not
even an array's memory is laid out by the file. Any other name ends the reading.
"""

import gzip
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

_MAX_BYTES = 1 << 28
_NUMBERS = "biuf"


class _Kept:
    """Stand-in for an object: what it was made with, and its state."""

    def __init__(self, *made_with: Any) -> None:
        self.made_with = made_with
        self.state: Any = None

    def __setstate__(self, state: object) -> None:
        self.state = state


class _Table(_Kept):
    """A data frame or its block manager."""


class _Index(_Kept):
    """Labels of an axis."""


class _Block(_Kept):
    """Columns of one type: values, placement, dimensions."""


class _Array(_Kept):
    """A numpy array; its state is (version, shape, type, column-major, data)."""


class _Type(_Kept):
    """A numpy type."""


class _Span(_Kept):
    """A slice."""


def _index(_kind: object, named: dict[str, Any]) -> _Index:
    return _Index(named)


def _scalar(kind: _Type, data: bytes = b"") -> Any:
    array = _Array()
    array.state = (1, (1,), kind, False, data)
    return _values(array).tolist()[0]


def _from_buffer(data: bytes, kind: _Type, shape: tuple[int, ...], order: str) -> _Array:
    array = _Array()
    array.state = (1, shape, kind, order == "F", data)
    return array


def _encoded(text: str, _coding: str = "latin1") -> bytes:
    return text.encode("latin1")


_NAMES: dict[tuple[str, str], Any] = {
    ("pandas.core.frame", "DataFrame"): _Table,
    ("pandas.core.internals.managers", "BlockManager"): _Table,
    ("pandas._libs.internals", "_unpickle_block"): _Block,
    ("pandas.core.indexes.base", "_new_Index"): _index,
    ("pandas.core.indexes.base", "Index"): _Index,
    ("pandas.core.indexes.numeric", "Int64Index"): _Index,
    ("pandas.core.indexes.range", "RangeIndex"): _Index,
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Type,
    ("builtins", "slice"): _Span,
    ("_codecs", "encode"): _encoded,
}
for _numpy in ("numpy.core", "numpy._core"):
    _NAMES[f"{_numpy}.multiarray", "_reconstruct"] = _Array
    _NAMES[f"{_numpy}.multiarray", "scalar"] = _scalar
    _NAMES[f"{_numpy}.numeric", "_frombuffer"] = _from_buffer


class _Reader(pickle.Unpickler):
    def find_class(self, module_name: str, global_name: str, /) -> Any:
        if (module_name, global_name) not in _NAMES:
            raise _ForeignNameError(f"{module_name}.{global_name}")
        return _NAMES[module_name, global_name]


class _ForeignNameError(pickle.UnpicklingError):
    pass


def read_pickled_table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a pickled data frame, gzipped; text comes as objects.

    Raises:
        BadInputError: the file is missing or corrupt, no data frame, larger than 256 MB unpacked,
            or names anything that a table does not need: it is then not executed.
    """
    with reading(path, "a gzipped pickle of a pandas table"):
        with gzip.open(path) as file:
            data = file.read(_MAX_BYTES + 1)
        if len(data) > _MAX_BYTES:
            raise BadInputError(f"{path}: more than 256 MB unpacked is no frame; get it again.")
        try:
            table = _Reader(io.BytesIO(data)).load()
        except _ForeignNameError as error:
            raise BadInputError(
                f"{path}: this pickle wants to use {error}, which no table needs; it was not "
                "executed: get the file from the data set's own source."
            ) from None
        return _columns(table)


def _columns(table: Any) -> dict[str, np.ndarray]:
    """Columns of a data frame as pandas before 3 keeps them."""
    if not isinstance(table, _Table) or not isinstance(table.state, dict):
        raise TypeError("no data frame")
    manager = table.state.get("_mgr") or table.state["_data"]
    axes, blocks = _axes_and_blocks(manager)
    labels = _values(axes[0].made_with[0]["data"]).tolist()
    columns = {}
    for values, placement in blocks:
        for row, column in zip(_values(values), _placement(placement), strict=True):
            columns[str(labels[column])] = row
    return columns


def _axes_and_blocks(manager: Any) -> tuple[list[Any], list[tuple[Any, Any]]]:
    if manager.state is None:  # pandas 1.3 and newer: (blocks, axes)
        blocks, axes = manager.made_with
        return axes, [block.made_with[:2] for block in blocks]
    named = manager.state[3]["0.14.1"]
    return named["axes"], [(block["values"], block["mgr_locs"]) for block in named["blocks"]]


def _placement(placement: Any) -> list[int]:
    if isinstance(placement, _Span):
        start, stop, step = placement.made_with
        return list(range(start, stop, step or 1))
    return _values(placement).tolist()


def _values(array: _Array) -> np.ndarray:
    """The array that a stand-in stands for: numbers from their bytes, or a list of objects."""
    _, shape, kind, column_major, data = array.state
    if isinstance(data, list):
        values = np.empty(len(data), object)
        values[:] = data
    else:
        values = np.frombuffer(data, _number_type(kind))
    return values.reshape(shape, order="F" if column_major else "C")


def _number_type(kind: _Type) -> np.dtype:
    code = kind.made_with[0]
    order = kind.state[1] if kind.state else "<"
    found = np.dtype(f"{order if order in '<>' else '='}{code}")
    if found.kind not in _NUMBERS:
        raise TypeError(f"a column of type {code}")
    return found
