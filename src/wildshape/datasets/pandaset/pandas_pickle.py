# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tables that pandas has pickled, read without pandas and without running what a pickle says.

A pickle is a program: it names things to import and to call. Here every name that it may say
(`_NAMES`) stands for a stand-in of ours that only keeps what it is given, numpy's own included: not
even an array's memory is laid out by the file. Any other name ends the reading, and so does any
instruction that is not in `_STEPS`. What an instruction changes was made by this very reading.
"""

import gzip
import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

_MAX_BYTES, _RATIO, _FREE_BYTES = 1 << 28, 4, 1 << 24  # unpacked; numbers shrink to a half
_MOST_STEPS = 200_000  # instructions; a frame's labels take 5,000
_NUMBERS = "biuf"


class _Kept:
    """Stand-in for an object: what it was made with, and its state."""

    def __init__(self, *made_with: Any) -> None:
        self.made_with = made_with
        self.state: Any = None


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
    (value,) = np.frombuffer(data, _number_type(kind))
    return value.item()


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


class _Reader(pickle._Unpickler):  # pyright: ignore[reportPrivateUsage]
    """Python's own reader: pickle.Unpickler gives memory to any number that a file says."""

    stack: list[Any]
    read: Callable[[int], bytes]
    pop_mark: Callable[[], list[Any]]
    steps = 0

    def __init__(self, data: bytes) -> None:
        super().__init__(io.BytesIO(data))
        self.encodable = len(data)

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _NAMES:
            raise _UnknownNameError(f"{module}.{name}")
        return _NAMES[module, name]

    def step(self, read: Callable[[Any], None]) -> None:
        self.steps += 1
        if self.steps > _MOST_STEPS:
            raise pickle.UnpicklingError(f"more than {_MOST_STEPS} instructions")
        read(self)

    def reduce(self) -> None:
        made_with = self.stack.pop()
        make = self.stack[-1]
        if not any(make is known for known in _NAMES.values()):
            raise pickle.UnpicklingError("a call of what is no name")
        if make is _encoded:  # one text may be encoded over and over
            self.encodable -= len(made_with[0])
            if self.encodable < 0:
                raise pickle.UnpicklingError("more text to encode than there is")
        self.stack[-1] = make(*made_with)

    def newobj(self) -> None:
        made_with = self.stack.pop()
        make = self.stack[-1]
        if not (isinstance(make, type) and issubclass(make, _Kept)):
            raise pickle.UnpicklingError("an object of what is no class")
        self.stack[-1] = make(*made_with)

    def build(self) -> None:
        state = self.stack.pop()
        if not isinstance(self.stack[-1], _Kept):
            raise pickle.UnpicklingError("a state for what was not made here")
        self.stack[-1].state = state

    def append_one(self) -> None:
        self._extend([self.stack.pop()])

    def append_all(self) -> None:
        self._extend(self.pop_mark())

    def _extend(self, items: list[Any]) -> None:
        if type(self.stack[-1]) is not list:
            raise pickle.UnpicklingError("items for what is no list")
        self.stack[-1].extend(items)

    def set_one(self) -> None:
        value = self.stack.pop()
        self._update([self.stack.pop(), value])

    def set_all(self) -> None:
        self._update(self.pop_mark())

    def _update(self, items: list[Any]) -> None:
        keys, values = items[::2], items[1::2]
        if type(self.stack[-1]) is not dict or not all(type(key) is str for key in keys):
            raise pickle.UnpicklingError("entries for what is no dictionary, or under no name")
        self.stack[-1].update(zip(keys, values, strict=True))

    def bytearray8(self) -> None:
        self.stack.append(self.read(int.from_bytes(self.read(8), "little")))


_OWN: dict[bytes, Callable[[_Reader], None]] = {
    pickle.REDUCE: _Reader.reduce,
    pickle.NEWOBJ: _Reader.newobj,
    pickle.BUILD: _Reader.build,
    pickle.APPEND: _Reader.append_one,
    pickle.APPENDS: _Reader.append_all,
    pickle.SETITEM: _Reader.set_one,
    pickle.SETITEMS: _Reader.set_all,
    pickle.BYTEARRAY8: _Reader.bytearray8,
}
_PYTHONS = """PROTO FRAME STOP MARK GLOBAL STACK_GLOBAL NONE NEWTRUE NEWFALSE BININT BININT1 BININT2
LONG1 BINFLOAT BINUNICODE SHORT_BINUNICODE BINUNICODE8 BINBYTES SHORT_BINBYTES BINBYTES8 EMPTY_TUPLE
TUPLE TUPLE1 TUPLE2 TUPLE3 EMPTY_LIST EMPTY_DICT BINPUT LONG_BINPUT MEMOIZE BINGET LONG_BINGET"""


def _steps() -> dict[int, Callable[[Any], None]]:
    pythons = {getattr(pickle, name)[0]: name for name in _PYTHONS.split()}
    reads = {code: pickle._Unpickler.dispatch[code] for code in pythons}  # pyright: ignore
    reads |= {code[0]: read for code, read in _OWN.items()}
    return {code: lambda reader, read=read: reader.step(read) for code, read in reads.items()}


_Reader.dispatch = _steps()


class _UnknownNameError(pickle.UnpicklingError):
    pass


def read_pickled_table(path: Path) -> dict[str, np.ndarray]:
    """The columns of a pickled data frame, gzipped, all of one length; text comes as objects.

    Raises:
        BadInputError: the file is missing or corrupt, no data frame, unpacks to more than a frame
            takes, or names anything that a table does not need: it is then not executed.
    """
    with reading(path, "a gzipped pickle of a pandas table"):
        data = _unpacked(path)
        try:
            table = _Reader(data).load()
        except _UnknownNameError as error:
            raise BadInputError(
                f"{path}: this pickle wants to use {error}, which no table needs; it was not "
                "executed: get the file from the data set's own source."
            ) from None
        return _columns(table, len(data))


def _unpacked(path: Path) -> bytes:
    most = min(_RATIO * path.stat().st_size + _FREE_BYTES, _MAX_BYTES)
    with gzip.open(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise BadInputError(f"{path}: more than {most >> 20} MB unpacked, no frame; get it again.")
    return data


def _columns(table: Any, most: int) -> dict[str, np.ndarray]:
    """Columns of a data frame as pandas before 3 keeps them; `most` cells, whoever shares them."""
    if not isinstance(table, _Table) or not isinstance(table.state, dict):
        raise TypeError("no data frame")
    manager = table.state.get("_mgr") or table.state["_data"]
    axes, blocks = _axes_and_blocks(manager)
    labels = _values(axes[0].made_with[0]["data"])
    columns: dict[str, np.ndarray] = {}
    for values, placement in blocks:
        rows, places = _values(values), _placement(placement)
        most -= rows.size + len(rows) + len(places)
        if most < 0 or labels.ndim != 1 or rows.ndim != 2 or len(rows) > len(labels):
            raise TypeError("more cells than the file holds")
        for row, column in zip(rows, places, strict=True):
            columns[str(labels[column])] = row
    if len({len(row) for row in columns.values()}) > 1:
        raise TypeError("columns of different lengths")
    return columns


def _axes_and_blocks(manager: Any) -> tuple[list[Any], list[tuple[Any, Any]]]:
    if manager.state is None:  # pandas 1.3 and newer: (blocks, axes)
        blocks, axes = manager.made_with
        return axes, [block.made_with[:2] for block in blocks]
    named = manager.state[3]["0.14.1"]
    return named["axes"], [(block["values"], block["mgr_locs"]) for block in named["blocks"]]


def _placement(placement: Any) -> range | np.ndarray:
    if isinstance(placement, _Span):
        start, stop, step = placement.made_with
        return range(start, stop, 1 if step is None else step)
    return _values(placement)


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
