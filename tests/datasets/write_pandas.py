# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pickles of data frames, opcode by opcode as pandas 0.25 wrote PandaSet's, without pandas."""

import gzip
import pickle
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Name:
    """Something that the pickle imports."""

    module: str
    name: str


@dataclass(frozen=True)
class Made:
    """An object that the pickle makes: by calling, or by `cls.__new__` where `new` is set."""

    by: Name
    arguments: tuple[Any, ...] = ()
    state: Any = None
    new: bool = False


FRAME = Name("pandas.core.frame", "DataFrame")
MANAGER = Name("pandas.core.internals.managers", "BlockManager")
_INDEX = Name("pandas.core.indexes.base", "_new_Index")


def pickled(value):
    """The bytes of a whole pickle, protocol 3."""
    return b"\x80\x03" + _opcodes(value) + b"."


def _opcodes(value):
    if isinstance(value, Name):
        return f"c{value.module}\n{value.name}\n".encode()
    if isinstance(value, Made):
        made = _opcodes(value.by) + _opcodes(value.arguments) + (b"\x81" if value.new else b"R")
        return made if value.state is None else made + _opcodes(value.state) + b"b"
    if isinstance(value, np.ndarray):
        return _opcodes(_array(value))
    if isinstance(value, tuple):
        return b"(" + b"".join(map(_opcodes, value)) + b"t"
    if isinstance(value, list):
        return b"](" + b"".join(map(_opcodes, value)) + b"e"
    if isinstance(value, dict):
        return b"}(" + b"".join(_opcodes(k) + _opcodes(v) for k, v in value.items()) + b"u"
    if isinstance(value, slice):
        bounds = (value.start, value.stop, value.step)
        return _opcodes(Made(Name("builtins", "slice"), bounds))
    return pickle.dumps(value, protocol=3)[2:-1]


def _array(values):
    code = "O8" if values.dtype == object else values.dtype.str[1:]
    order = "<" if values.dtype.kind in "iuf" and values.dtype.itemsize > 1 else "|"
    flags = 63 if values.dtype == object else 0
    state = (3, order, None, None, None, -1, -1, flags)
    kind = Made(Name("numpy", "dtype"), (code, 0, 1), state)
    data = values.ravel().tolist() if values.dtype == object else values.tobytes()
    made_with = (Name("numpy", "ndarray"), (0,), b"b")
    return Made(
        Name("numpy.core.multiarray", "_reconstruct"),
        made_with,
        (1, values.shape, kind, False, data),
    )


def _index(labels):
    values = np.empty(len(labels), object)
    values[:] = labels
    kind = Name("pandas.core.indexes.base", "Index")
    return Made(_INDEX, (kind, {"data": values, "name": None}))


def frame(columns):
    """A data frame of columns `(n,)`, by type in blocks as pandas groups them."""
    names, rows = list(columns), len(next(iter(columns.values())))
    groups = {}
    for i, name in enumerate(names):
        groups.setdefault(columns[name].dtype, []).append(i)
    values = [np.stack([columns[names[i]] for i in where]) for where in groups.values()]
    span = Name("pandas.core.indexes.range", "RangeIndex")
    index = Made(_INDEX, (span, {"name": None, "start": 0, "stop": rows, "step": 1}))
    axes = [_index(names), index]
    blocks = [
        {"values": block, "mgr_locs": _places(where)}
        for block, where in zip(values, groups.values())
    ]
    items = [_index([names[i] for i in where]) for where in groups.values()]
    state = (axes, values, items, {"0.14.1": {"axes": axes, "blocks": blocks}})
    manager = Made(MANAGER, state=state, new=True)
    return Made(FRAME, state={"_data": manager, "_typ": "dataframe", "_metadata": []}, new=True)


def _places(where):
    """A slice where the columns are neighbours, as pandas has it."""
    if where == list(range(where[0], where[-1] + 1)):
        return slice(where[0], where[-1] + 1, 1)
    return np.array(where, np.int64)


def write_frame(path, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(pickled(frame(columns)), 1))
