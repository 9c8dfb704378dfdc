# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Footers of parquet files: read as pyarrow reads them, and damage ends no process."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from tests.io.limits import costs

from wildshape.datasets.waymo.footer import row_groups
from wildshape.datasets.waymo.tables import range_images
from wildshape.errors import BadInputError

_COLUMN = "[LiDARPoseComponent].range_image_return1"


def _table(frames: int = 3) -> pa.Table:
    return pa.table(
        {
            "key.frame_timestamp_micros": np.arange(frames),
            "key.laser_name": np.ones(frames, np.int8),
            f"{_COLUMN}.values": pa.array([[1.0] * 12] * frames, pa.list_(pa.float32())),
            f"{_COLUMN}.shape": pa.array([[1, 2, 6]] * frames, pa.list_(pa.int32())),
            "more": pa.array([["a", None], None, []], pa.list_(pa.string())),
            "nested": pa.array([{"x": True, "y": 1.5}] * frames),
        }
    )


@pytest.mark.parametrize("version", ["1.0", "2.4", "2.6"])
@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_the_counts_are_pyarrows(version: str, compression: str, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    parquet.write_table(
        _table(),
        path,
        version=version,
        compression=compression,
        row_group_size=2,
        write_page_index=True,
        store_decimal_as_integer=True,
    )
    metadata = parquet.read_metadata(path)
    theirs = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    for ours, group in zip(row_groups(path), theirs, strict=True):
        columns = [group.column(i) for i in range(group.num_columns)]
        assert ours.rows == group.num_rows
        assert ours.values == [(c.path_in_schema, c.num_values) for c in columns]


def read_all(folder: Path) -> list[int]:
    """Read each file, or have it refused."""
    for path in folder.iterdir():
        try:
            list(range_images(path, "LiDARPoseComponent"))
        except BadInputError:
            continue
    return [1]


def test_no_changed_byte_of_a_footer_ends_the_process(tmp_path: Path) -> None:
    folder = tmp_path / "damaged"
    folder.mkdir()
    whole = tmp_path / "whole.parquet"
    parquet.write_table(_table(), whole)
    data = whole.read_bytes()
    start = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    for place in range(start, len(data) - 8):
        for changed in {data[place] ^ 2, data[place] ^ 16, 0x19} - {data[place]}:
            name = f"{place}-{changed}.parquet"
            (folder / name).write_bytes(data[:place] + bytes([changed]) + data[place + 1 :])
    (cost,) = costs("tests.datasets.waymo.test_footer:read_all", [folder], cpu_s=60)
    assert cost.error == ""
