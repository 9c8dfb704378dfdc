# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""boxes.csv: what is written is read, and nothing else is."""

import pytest
from tests.refusal import refused

from wildshape.io.boxes.table import BoxRow, read_box_table, write_box_table

ROWS = [
    BoxRow(0, 0.0, "0002", 9.0, 2.5, -0.9, 4.2, 1.8, 1.5, 0.25, 0.875, 7, False),
    BoxRow(0, 1700000001.223456, "0003", 8.0, -2.5, -0.9, 4.2, 1.8, 1.5, 0.25, 0.875, 120, False),
    BoxRow(2, None, "0001", -4.0, 3.0, -1.0, 4.6, 1.9, 1.4, -3.0, 0.5, 0, True),
]


def test_what_is_written_is_read_by_frame_and_track(tmp_path):
    write_box_table(tmp_path / "boxes.csv", reversed(ROWS))
    assert read_box_table(tmp_path / "boxes.csv") == ROWS
    lines = (tmp_path / "boxes.csv").read_text().splitlines()
    (tmp_path / "boxes.csv").write_text("\ufeff" + "\n".join(lines), "utf-8")  # as of Excel
    assert read_box_table(tmp_path / "boxes.csv") == ROWS
    assert lines[3] == "2,,0001,-4.0,3.0,-1.0,4.6,1.9,1.4,-3.0,0.5,0,1"


@pytest.mark.parametrize(
    "damage",
    [
        ("frame,time", "frame,when"),
        (",120,0", ",many,0"),
        (",120,0", ",120,yes"),
        ("4.2", "nan"),
        ("1700000001.223456", "nan"),
        (",1700000001.223456,0003", ",0003"),
    ],
)
def test_another_table_is_refused(tmp_path, damage):
    path = tmp_path / "boxes.csv"
    write_box_table(path, ROWS)
    path.write_text(path.read_text().replace(*damage, 1))
    refused(read_box_table, path, match="boxes.csv: expected")
