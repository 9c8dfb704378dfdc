# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How many rows and values the footer of a parquet file claims.

pyarrow tells it too, but ends the process on some damaged footers: `RowGroupMetaData.column`
throws in C++ what nothing catches. The footer is a struct in Thrift's compact protocol, its fields
numbered as in parquet-format's `parquet.thrift`.
"""

from pathlib import Path
from typing import Any, NamedTuple

_TAIL = 8
# FileMetaData.row_groups, RowGroup.columns and .num_rows, ColumnChunk.meta_data,
# ColumnMetaData.path_in_schema and .num_values
_GROUPS, _COLUMNS, _ROWS, _DATA, _PATH, _VALUES = 4, 1, 3, 3, 3, 5
_WANTED = {_GROUPS: {_COLUMNS: {_DATA: {_PATH: {}, _VALUES: {}}}, _ROWS: {}}}
_LONGEST_NUMBER = 70  # bits

_Wanted = dict[int, Any]


class RowGroup(NamedTuple):
    """Rows that lie together; of each column its path, with dots, and how many values it has."""

    rows: int
    values: list[tuple[str, int]]


def row_groups(path: Path) -> list[RowGroup]:
    """All of a parquet file.

    Raises:
        Exception: of any kind; the file is damaged.
    """
    groups = _Thrift(_footer(path)).struct(_WANTED)[_GROUPS]
    return [RowGroup(g[_ROWS], [_named(c[_DATA]) for c in g[_COLUMNS]]) for g in groups]


def _named(column: dict[int, Any]) -> tuple[str, int]:
    return b".".join(column[_PATH]).decode(), column[_VALUES]


def _footer(path: Path) -> bytes:
    with path.open("rb") as file:
        end = file.seek(-_TAIL, 2)
        length = int.from_bytes(file.read(4), "little")
        file.seek(end - length)
        return file.read(length)


class _Thrift:
    """Reads from the start; what is not wanted is passed over."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def struct(self, wanted: _Wanted) -> dict[int, Any]:
        """The wanted fields by their numbers; those wanted of each are a dict in turn."""
        found, number = {}, 0
        while header := self._byte():
            number = number + (header >> 4) if header >> 4 else self._signed()
            value = self._value(header & 15, wanted.get(number))
            if number in wanted:
                found[number] = value
        return found

    def _value(self, kind: int, wanted: _Wanted | None) -> Any:
        match kind:
            case 1 | 2:
                return kind == 1
            case 3:
                return self._byte()
            case 4 | 5 | 6:
                return self._signed()
            case 7:
                return self._bytes(8)
            case 8:
                return self._bytes(self._unsigned())
        return self._container(kind, wanted)

    def _container(self, kind: int, wanted: _Wanted | None) -> Any:
        match kind:
            case 9 | 10:
                return self._items(wanted)
            case 11:
                return self._pairs()
            case 12:
                return self.struct(wanted or {})
        raise ValueError(f"a value of the unknown type {kind}")

    def _items(self, wanted: _Wanted | None) -> list[Any]:
        header = self._byte()
        count = header >> 4 if header >> 4 < 15 else self._unsigned()
        found = []
        for _ in range(count):
            value = self._item(header & 15, wanted)
            if wanted is not None:
                found.append(value)
        return found

    def _pairs(self) -> None:
        count = self._unsigned()
        kinds = self._byte() if count else 0
        for _ in range(count):
            self._item(kinds >> 4, None)
            self._item(kinds & 15, None)

    def _item(self, kind: int, wanted: _Wanted | None) -> Any:
        # Truth has a byte of its own where no field's header tells it.
        return self._byte() if kind in (1, 2) else self._value(kind, wanted)

    def _signed(self) -> int:
        number = self._unsigned()
        return (number >> 1) ^ -(number & 1)

    def _unsigned(self) -> int:
        number = 0
        for shift in range(0, _LONGEST_NUMBER, 7):
            byte = self._byte()
            number |= (byte & 127) << shift
            if byte < 128:
                return number
        raise ValueError("a number of more than 64 bits")

    def _byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def _bytes(self, count: int) -> bytes:
        self._at += count
        if self._at > len(self._data):
            raise ValueError("cut off")
        return self._data[self._at - count : self._at]
