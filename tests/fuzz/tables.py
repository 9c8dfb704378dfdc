# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damage to Arrow's tables, feather and parquet: columns and cells that are valid and wrong."""

import io
from functools import cache
from random import Random
from typing import Any

import numpy as np
from tests.fuzz.containers import BOMB
from tests.fuzz.mutations import damage

_MOST_ROWS = 100_000  # a bomb, of which lists would be made


def change_feather(rng: Random, data: bytes) -> bytes:
    """A column of a feather table."""
    from pyarrow import feather

    try:
        table = feather.read_table(io.BytesIO(data), memory_map=False)
        if table.num_rows > _MOST_ROWS:
            return damage(rng, data)
        file = io.BytesIO()
        compression = rng.choice(("uncompressed", "lz4", "zstd"))
        feather.write_feather(_changed_table(rng, table), file, compression)
    except Exception:  # noqa: BLE001
        return damage(rng, data)
    return file.getvalue()


def change_parquet(rng: Random, data: bytes) -> bytes:
    """A column of a parquet table."""
    from pyarrow import parquet

    try:
        table = parquet.read_table(io.BytesIO(data))
        if table.num_rows > _MOST_ROWS:
            return damage(rng, data)
        file = io.BytesIO()
        compression = rng.choice(("none", "snappy", "zstd", "gzip"))
        parquet.write_table(_changed_table(rng, table), file, compression=compression)
    except Exception:  # noqa: BLE001
        return damage(rng, data)
    return file.getvalue()


def change_footer(rng: Random, data: bytes) -> bytes:
    """Some bytes of a parquet file's footer, its length right."""
    length = int.from_bytes(data[-8:-4], "little")
    footer = damage(rng, data[-8 - length : -8])
    return data[: -8 - length] + footer + len(footer).to_bytes(4, "little") + data[-4:]


def _changed_table(rng: Random, table: Any) -> Any:
    """A column lost, renamed, of another type, with other values; rows lost, doubled, mixed."""
    import pyarrow as pa

    table.validate(full=True)  # of a damaged one `take` reads anywhere
    i = rng.randrange(table.num_columns)
    name, count = table.column_names[i], table.num_rows
    match rng.randrange(6):
        case 0:
            return table.drop_columns([name])
        case 1:
            return table.rename_columns([c if c != name else "x" for c in table.column_names])
        case 2:
            rows = [
                rng.randrange(max(count, 1)) for _ in range(rng.choice((0, 1, count, 2 * count)))
            ]
            return table.take(pa.array(rows if count else [], pa.int64()))
        case 3:
            return table.set_column(i, name, pa.array(_column(rng, count)))
        case 4:
            kind = rng.choice((pa.string(), pa.float16(), pa.float64(), pa.int8(), pa.int64()))
            return table.set_column(i, name, table.column(i).cast(kind, safe=False))
        case _:
            values = table.column(i).to_pylist()
            if values:
                values[rng.randrange(count)] = _cell(rng, values[0])
            return table.set_column(i, name, pa.array(values, table.column(i).type))


def _cell(rng: Random, like: Any) -> Any:
    if isinstance(like, float):
        return rng.choice((None, float("nan"), float("inf"), 0.0, -1e308, 1e30, -like))
    if isinstance(like, int):
        return rng.choice((None, 0, -1, like + 1, 1 << 62, 127))
    if isinstance(like, str):
        return rng.choice((None, "", "x", like + like, "\0", "/"))
    if isinstance(like, list) and like:
        return rng.choice((None, [], like[:-1], like * 2, [_cell(rng, like[0]), *like[1:]], [None]))
    return None


def _column(rng: Random, count: int) -> list[Any]:
    value = rng.choice(
        (None, 0, 1.5, "x", True, b"x", [1.0], [], {"a": 1}, -1, float("nan"), 1 << 62)
    )
    return [value] * count


def _constant_table() -> Any:
    import pyarrow as pa

    return pa.table({"timestamp_ns": np.zeros(BOMB // 8, np.int64)})


@cache
def feather_bomb() -> bytes:
    """128 MB of equal numbers, packed."""
    from pyarrow import feather

    file = io.BytesIO()
    feather.write_feather(_constant_table(), file, "zstd")
    return file.getvalue()


@cache
def parquet_bomb() -> bytes:
    """The same."""
    from pyarrow import parquet

    file = io.BytesIO()
    parquet.write_table(_constant_table(), file, compression="zstd")
    return file.getvalue()
